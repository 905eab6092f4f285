"use strict";
// Turns the body on the canvas to the attitude at the cursor. `run` has time (s), quaternion (body to navigation frame,
// scalar first), enu (east, north and up in navigation axes) and up (sign of the body's z axis upwards).

(function () {
  if (!run) return;
  const canvas = document.getElementById("attitude"), context = canvas.getContext("2d");
  const slider = document.getElementById("cursor"), reading = document.getElementById("reading");
  document.getElementById("view").hidden = false;
  slider.max = run.time.length - 1;

  // Faces of the body, in forward, sideways and upward: a flat arrow with a fin.
  const faces = [
    { points: [[1.2, 0, 0], [-0.8, 0.75, 0], [-0.5, 0, 0]], colour: "#3d85c6" },
    { points: [[1.2, 0, 0], [-0.8, -0.75, 0], [-0.5, 0, 0]], colour: "#6fa8dc" },
    { points: [[-0.1, 0, 0], [-0.75, 0, 0.5], [-0.55, 0, 0]], colour: "#cc6633" }];

  function turned(q, v) {
    const [w, x, y, z] = q, [a, b, c] = v;
    const s = [2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)];
    return [a + w * s[0] + y * s[2] - z * s[1], b + w * s[1] + z * s[0] - x * s[2], c + w * s[2] + x * s[1] - y * s[0]];
  }

  function toEnu(v) {
    return run.enu.map(row => row[0] * v[0] + row[1] * v[1] + row[2] * v[2]);
  }

  // Seen from the south, from 25 degrees above: x to the right, y upwards, depth away from the eye.
  const sine = Math.sin(25 * Math.PI / 180), cosine = Math.cos(25 * Math.PI / 180);
  function projected([east, north, up]) {
    return { x: 320 + 210 * east, y: 330 - 210 * (cosine * up + sine * north), depth: cosine * north - sine * up };
  }

  function line(from, to, label) {
    const a = projected(from), b = projected(to);
    context.beginPath();
    context.moveTo(a.x, a.y);
    context.lineTo(b.x, b.y);
    context.stroke();
    context.fillText(label, b.x + 6, b.y - 6);
  }

  function draw(index) {
    const q = run.quaternion[index];
    context.clearRect(0, 0, canvas.width, canvas.height);
    context.lineWidth = 2;
    context.strokeStyle = context.fillStyle = "#999999";
    context.font = "24px system-ui, sans-serif";
    line([0, 0, 0], [1.3, 0, 0], "E");
    line([0, 0, 0], [0, 1.3, 0], "N");
    line([0, 0, 0], [0, 0, 1.2], "up");
    faces.map(face => {
      const corners = face.points.map(p => projected(toEnu(turned(q, [p[0], p[1], run.up * p[2]]))));
      return { corners, colour: face.colour, depth: corners.reduce((sum, c) => sum + c.depth, 0) };
    }).sort((a, b) => b.depth - a.depth).forEach(face => {
      context.beginPath();
      face.corners.forEach((c, k) => k ? context.lineTo(c.x, c.y) : context.moveTo(c.x, c.y));
      context.closePath();
      context.fillStyle = face.colour;
      context.fill();
      context.strokeStyle = "#10243e";
      context.stroke();
    });
    slider.value = index;
    reading.textContent = "t = " + run.time[index].toFixed(3) + " s, q = (" + q.map(v => v.toFixed(3)).join(", ") + ")";
  }

  function nearest(time) {
    let low = 0, high = run.time.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (run.time[middle] > time) high = middle; else low = middle;
    }
    return time - run.time[low] > run.time[high] - time ? high : low;
  }

  slider.addEventListener("input", () => draw(Number(slider.value)));
  document.getElementById("curves").on("plotly_hover", event => draw(nearest(event.points[0].x)));
  draw(0);
})();
