"use strict";
// Draws the body, and the lines of its sensors, at the cursor. `run` has
//   time      of each place of the cursor, s;
//   attitude  null, or: quaternion (body to navigation frame, scalar first, or null), enu (east, north and up in
//             navigation axes), names (of these three), up (sign of the body's z axis upwards);
//   lines     a list of sensors: name, most (the largest count), and for each time first (pixel of the first count),
//             counts, levels (by name), begin, width and centre of the run, pixels; a width of zero means none.

(function () {
  if (!run.attitude && !run.lines.length) return;
  const slider = document.getElementById("cursor"), reading = document.getElementById("reading");
  document.getElementById("view").hidden = false;
  slider.max = run.time.length - 1;
  const views = [];

  function show(index) {
    slider.value = index;
    reading.textContent = ["t = " + run.time[index].toFixed(4) + " s", ...views.map(draw => draw(index))].join(", ");
  }

  function attitudeView({ quaternion, enu, names, up }, canvas) {
    const context = canvas.getContext("2d");
    // Faces of the body, in forward, sideways and upward: a flat arrow with a fin.
    const faces = [
      { points: [[1.2, 0, 0], [-0.8, 0.75, 0], [-0.5, 0, 0]], colour: "#3d85c6" },
      { points: [[1.2, 0, 0], [-0.8, -0.75, 0], [-0.5, 0, 0]], colour: "#6fa8dc" },
      { points: [[-0.1, 0, 0], [-0.75, 0, 0.5], [-0.55, 0, 0]], colour: "#cc6633" }];

    function turned(q, v) {
      const [w, x, y, z] = q, [a, b, c] = v;
      const s = [2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)];
      return [a + w * s[0] + y * s[2] - z * s[1], b + w * s[1] + z * s[0] - x * s[2],
              c + w * s[2] + x * s[1] - y * s[0]];
    }

    function toEnu(v) {
      return enu.map(row => row[0] * v[0] + row[1] * v[1] + row[2] * v[2]);
    }

    // Seen from the south, from 25 degrees above: x to the right, y upwards, depth away from the eye.
    const sine = Math.sin(25 * Math.PI / 180), cosine = Math.cos(25 * Math.PI / 180);
    function projected([east, north, height]) {
      return { x: 320 + 210 * east, y: 330 - 210 * (cosine * height + sine * north),
               depth: cosine * north - sine * height };
    }

    function axis(to, label) {
      const a = projected([0, 0, 0]), b = projected(to);
      context.beginPath();
      context.moveTo(a.x, a.y);
      context.lineTo(b.x, b.y);
      context.stroke();
      context.textAlign = b.x > 500 ? "right" : "left";
      context.fillText(label, b.x + 6, b.y - 6);
    }

    return function (index) {
      const q = quaternion[index];
      context.clearRect(0, 0, canvas.width, canvas.height);
      context.lineWidth = 2;
      context.strokeStyle = context.fillStyle = "#999999";
      context.font = "24px system-ui, sans-serif";
      axis([1.3, 0, 0], names[0]);
      axis([0, 1.3, 0], names[1]);
      axis([0, 0, 1.2], names[2]);
      if (!q) return "no attitude";
      faces.map(face => {
        const corners = face.points.map(p => projected(toEnu(turned(q, [p[0], p[1], up * p[2]]))));
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
      return "q = (" + q.map(v => v.toFixed(3)).join(", ") + ")";
    };
  }

  function lineView(sensor, canvas) {
    const context = canvas.getContext("2d"), left = 70, right = 620, top = 50, bottom = 290;

    return function (index) {
      const counts = sensor.counts[index], first = sensor.first[index], width = sensor.width[index];
      const most = 1.1 * Math.max(sensor.most, 1), step = (right - left) / counts.length;
      // Pixels are as wide as a step, with their number in its middle.
      const x = pixel => left + (pixel - first + 0.5) * step, y = count => bottom - (bottom - top) * count / most;

      function bars(from, to, base) {
        context.beginPath();
        context.moveTo(x(from - 0.5), y(base));
        for (let pixel = from; pixel < to; pixel++) {
          const height = y(Math.max(counts[pixel - first], base));
          context.lineTo(x(pixel - 0.5), height);
          context.lineTo(x(pixel + 0.5), height);
        }
        context.lineTo(x(to - 0.5), y(base));
      }

      context.clearRect(0, 0, canvas.width, canvas.height);
      context.lineWidth = 2;
      context.font = "22px system-ui, sans-serif";
      const threshold = sensor.levels.threshold[index];
      if (width) {
        bars(Math.max(sensor.begin[index], first), Math.min(sensor.begin[index] + width, first + counts.length),
             threshold);
        context.fillStyle = "#8fc1ea";
        context.fill();
      }
      bars(first, first + counts.length, 0);
      context.strokeStyle = "#10243e";
      context.stroke();
      context.strokeStyle = "#e0a458";
      context.fillStyle = "#8a6020";
      context.textAlign = "left";
      let below = Infinity;
      Object.entries(sensor.levels).forEach(([name, levels]) => {
        const height = y(levels[index]);
        context.beginPath();
        context.moveTo(left, height);
        context.lineTo(right, height);
        context.stroke();
        // A name that would cover the one below it is left out.
        if (below - height < 22) return;
        context.fillText(name, left + 4, height - 6);
        below = height;
      });
      if (width) {
        context.strokeStyle = "#cc6633";
        context.beginPath();
        context.moveTo(x(sensor.centre[index]), top);
        context.lineTo(x(sensor.centre[index]), bottom);
        context.stroke();
      }
      context.fillStyle = "#10243e";
      context.fillText(sensor.name + ": " + (width ? "centre " + sensor.centre[index].toFixed(3) + ", run of " + width
                                                   : "no spot"), left, 30);
      context.fillText(String(first), left, bottom + 26);
      context.textAlign = "right";
      context.fillText("pixel " + (first + counts.length - 1), right, bottom + 26);
      context.fillText(String(sensor.most), left - 6, y(sensor.most) + 8);
      context.fillText("0", left - 6, bottom + 8);
      return sensor.name + (width ? " " + sensor.centre[index].toFixed(3) : ": no spot");
    };
  }

  const attitude = document.getElementById("attitude");
  if (run.attitude) views.push(attitudeView(run.attitude, attitude));
  attitude.hidden = !run.attitude;
  run.lines.forEach(sensor => {
    const canvas = document.createElement("canvas");
    canvas.width = 640;
    canvas.height = 330;
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", "line of the " + sensor.name + " at the cursor");
    document.getElementById("lines").append(canvas);
    views.push(lineView(sensor, canvas));
  });

  function nearest(time) {
    let low = 0, high = run.time.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (run.time[middle] > time) high = middle; else low = middle;
    }
    return time - run.time[low] > run.time[high] - time ? high : low;
  }

  slider.addEventListener("input", () => show(Number(slider.value)));
  document.getElementById("curves").on("plotly_hover", event => show(nearest(event.points[0].x)));
  show(0);
})();
