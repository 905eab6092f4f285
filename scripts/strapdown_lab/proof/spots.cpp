// Runs a Verilated spot finder over random lines and compares each result with the rule, computed here in plain loops.
// The generated ports.h names the module.
//
//   MODEL SEED LINES PIXELS GAP WIDTH_MAX LATENCY
//
// Prints a line for each of the first ten mismatches, then a line with the number of mismatches, and one with the
// number of lines with a spot, and with several. Status 3: finish rose in a wrong cycle.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "verilated.h"
#include "ports.h"

static MODEL_TYPE *dut;
static uint64_t state;

// xorshift64*
static uint32_t noise(uint32_t below) {
    state ^= state >> 12;
    state ^= state << 25;
    state ^= state >> 27;
    return uint64_t(uint32_t(state * 0x2545F4914F6CDD1Dull >> 32)) * below >> 32;
}

struct Spot {
    uint64_t found = 0, position = 0, peak = 0, width = 0, sum = 0, saturated = 0, several = 0, edge = 0, black = 0;
    uint64_t line_peak = 0, line_saturated = 0;
    bool operator==(const Spot &other) const {
        return found == other.found && position == other.position && peak == other.peak && width == other.width &&
               sum == other.sum && saturated == other.saturated && several == other.several && edge == other.edge &&
               black == other.black && line_peak == other.line_peak && line_saturated == other.line_saturated;
    }
};

static Spot rule(const std::vector<int> &line, int black, int lo, int hi, int gap, int width_max) {
    Spot best;
    const int count = int(line.size());
    best.black = ~0ull;
    for (int block = 0; block + 64 <= count; block += 64) {
        uint64_t sum = 0;
        for (int i = 0; i < 64; i++) sum += line[block + i];
        best.black = std::min(best.black, sum / 64);
    }
    const int highest = *std::max_element(line.begin(), line.end());
    best.line_peak = std::max(highest - black, 0);
    best.line_saturated = highest >= 4000;
    for (int start = 0; start < count; start++) {
        if (line[start] - black <= lo) continue;
        // A run: its last pixel that counts, and all sums from the begin.
        Spot run;
        uint64_t moment = 0;
        int last = start, i = start;
        for (; i < count && i - last <= gap && i - start < width_max; i++) {
            const int d = line[i] - black;
            if (d <= lo) continue;
            last = i;
            run.sum += d - lo;
            moment += uint64_t(i - start) * (d - lo);
            run.peak = std::max<uint64_t>(run.peak, d);
            run.saturated += line[i] >= 4000;
        }
        if (int(run.peak) > hi && last - start + 1 < width_max) {
            run.several = best.found;
            run.found = 1;
            if (run.sum > best.sum) {
                run.position = (uint64_t(start) << 12) + (moment << 12) / run.sum;
                run.width = last - start + 1;
                run.edge = start == 0 || last == count - 1;
                run.black = best.black;
                run.line_peak = best.line_peak;
                run.line_saturated = best.line_saturated;
                best = run;
            }
            best.several = run.several;
        }
        // After the gap, or at the cut, the next run may begin at once.
        start = std::min(last + gap, start + width_max - 1);
    }
    return best;
}

static void fill(std::vector<int> &line) {
    const int count = int(line.size()), kind = noise(8), base = noise(200);
    if (kind == 0) {
        for (auto &pixel : line) pixel = noise(4096);
    } else if (kind == 1) {
        const int rare = 1 + noise(60);
        for (auto &pixel : line) pixel = noise(rare) ? base + noise(30) : noise(4096);
    } else {
        for (auto &pixel : line) pixel = base + noise(16);
        if (kind == 2) {
            // Steps.
            for (int step = 1 + noise(4); step; step--) {
                const int begin = noise(count), end = begin + noise(count - begin + 1), height = noise(4096);
                for (int i = begin; i < end; i++) line[i] = height;
            }
        } else {
            for (int spots = 1 + noise(3); spots; spots--) {
                const int64_t middle = int(noise(count + 20)) - 10, height = noise(6000);
                const int64_t square = 1 + noise(1 + (1 << 2 * noise(7)));
                for (int i = 0; i < count; i++) line[i] += height * square / (square + (i - middle) * (i - middle));
            }
        }
    }
    for (auto &pixel : line) pixel = std::min(pixel, 4095);
}

static void cycle(bool valid, bool first, bool last, int pixel) {
    dut->valid = valid;
    dut->first = first;
    dut->last = last;
    dut->pixel = pixel;
    dut->clk = 0;
    dut->eval();
    dut->clk = 1;
    dut->eval();
}

static void print(const char *word, const Spot &spot) {
    printf(" %s", word);
    for (uint64_t value : {spot.found, spot.position, spot.peak, spot.width, spot.sum, spot.saturated, spot.several,
                           spot.edge, spot.black, spot.line_peak, spot.line_saturated})
        printf(" %llu", (unsigned long long)value);
}

int main(int, char **arguments) {
    dut = new MODEL_TYPE;
    state = strtoull(arguments[1], nullptr, 10) * 2 + 1;
    const uint64_t lines = strtoull(arguments[2], nullptr, 10);
    const int pixels = atoi(arguments[3]), gap = atoi(arguments[4]), width_max = atoi(arguments[5]),
              latency = atoi(arguments[6]);
    for (int i = 0; i < 100; i++) noise(2);
    dut->rst = 1;
    for (int i = 0; i < 3; i++) cycle(false, false, false, 0);
    dut->rst = 0;

    uint64_t mismatches = 0, found = 0, several = 0;
    std::vector<int> line(pixels);
    Spot before;
    for (uint64_t number = 0; number < lines; number++) {
        fill(line);
        // Thresholds as from the line before, or any.
        int black = int(before.black), lo = std::max<int>(40, before.line_peak >> 2), hi = std::max(80, lo + (lo >> 1));
        if (noise(2)) black = noise(250), lo = noise(600), hi = noise(1200);
        dut->black = black;
        dut->lo = lo;
        dut->hi = hi;
        const int distance = noise(4);
        for (int i = 0; i < pixels; i++) {
            for (int wait = distance ? noise(distance) : 0; wait; wait--) cycle(false, noise(2), noise(2), noise(4096));
            cycle(true, i == 0, i == pixels - 1, line[i]);
        }
        for (int wait = 1; wait < latency; wait++) {
            if (dut->finish) return 3;
            cycle(false, noise(2), noise(2), noise(4096));
        }
        if (!dut->finish) return 3;
        for (int wait = noise(3); wait; wait--) cycle(false, noise(2), noise(2), noise(4096));
        Spot got;
        got.found = dut->found;
        got.position = dut->position;
        got.peak = dut->peak;
        got.width = dut->width;
        got.sum = dut->sum;
        got.saturated = dut->saturated;
        got.several = dut->several;
        got.edge = dut->touches;
        got.black = dut->black_next;
        got.line_peak = dut->line_peak;
        got.line_saturated = dut->line_saturated;
        const Spot wanted = rule(line, black, lo, hi, gap, width_max);
        found += wanted.found;
        several += wanted.several;
        if (!(got == wanted) && mismatches++ < 10) {
            printf("line %llu", (unsigned long long)number);
            print("gives", got);
            print("not", wanted);
            printf("\n");
        }
        before = wanted;
    }
    printf("%llu\n%llu %llu\n", (unsigned long long)mismatches, (unsigned long long)found,
           (unsigned long long)several);
}
