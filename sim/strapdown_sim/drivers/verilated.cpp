// Runs one Verilated module over rows of stimulus. The generated ports.h names the module, its
// clock and reset, and lists its ports; rows are little-endian 64-bit words, one a port.
//
//   MODEL stream    each row is one clock cycle; the answer holds the outputs in that cycle,
//                   before its closing edge
//   MODEL transact LIMIT
//                   each row is one START..FINISH transaction; the answer holds the outputs when
//                   FINISH has risen, the probes, and the cycles it took (0: not within LIMIT)
//   MODEL transact LIMIT FILE
//                   with KEEP_WAVES, in place of that: before the words of a row comes its time in ns,
//                   or ~0; the cycles of rows with a time are written to a waveform file, from that
//                   time on, or from the end of the row before
//   MODEL offer LIMIT
//                   each row is the cycles to wait (~0: reset), and a sample to offer until READY;
//                   the answer, at each FINISH, holds the outputs, the probes, the number of the row
//                   and those of the edges that took the sample and raised FINISH
//
// Stimulus comes in on standard input, after the constants of the engine if the model is made without them; answers go
// out on standard output as they arise.
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>

#include "verilated.h"
#include "ports.h"

static MODEL_TYPE *dut;

#ifdef KEEP_WAVES
#include "verilated_vcd_c.h"

static const uint64_t HALF_NS = 5;
static VerilatedVcdC *waves;
static uint64_t now;
static bool shown;

static void open_waves(const char *file) {
    waves = new VerilatedVcdC;
    waves->set_time_unit("1ns");
    waves->set_time_resolution("1ns");
    dut->trace(waves, 99);
    waves->open(file);
}

static void record() {
    if (!shown) return;
    waves->dump(now);
    now += HALF_NS;
}

static bool read_time() {
    uint64_t time;
    if (fread(&time, sizeof time, 1, stdin) != 1) return false;
    shown = time != ~uint64_t(0);
    if (shown && time > now) now = time;
    return true;
}
#else
static void record() {}
static bool read_time() { return true; }
#endif

static void tick() {
    dut->CLOCK = 0;
    dut->eval();
    record();
    dut->CLOCK = 1;
    dut->eval();
    record();
}

static void reset() {
#ifdef RESET
    dut->RESET = RESET_ACTIVE;
    for (int cycle = 0; cycle < 3; cycle++) tick();
    dut->RESET = !RESET_ACTIVE;
    // It acts a little longer.
    for (int cycle = 0; cycle < 3; cycle++) tick();
#endif
}

static void fill() {
#ifdef CONSTANTS
    for (auto &constant : dut->rootp->CONSTANTS.m_storage) {
        uint64_t word = 0;
        if (fread(&word, sizeof word, 1, stdin) == 1) constant = word;
    }
#endif
}

static bool read_row(uint64_t *row) { return fread(row, sizeof *row, INPUT_COUNT, stdin) == INPUT_COUNT; }

static void drive(const uint64_t *row) {
#define INPUT(port) dut->port = *row++;
    INPUTS
#undef INPUT
}

static uint64_t *sample(uint64_t *row) {
#define OUTPUT(port) *row++ = dut->port;
    OUTPUTS
#undef OUTPUT
    return row;
}

static void stream() {
    uint64_t in[INPUT_COUNT + 1], out[OUTPUT_COUNT + 1];
    while (read_row(in)) {
        drive(in);
        dut->CLOCK = 0;
        dut->eval();
        sample(out);
        fwrite(out, sizeof *out, OUTPUT_COUNT, stdout);
        dut->CLOCK = 1;
        dut->eval();
    }
}

#ifdef START
static void transact(uint64_t limit) {
    uint64_t in[INPUT_COUNT + 1], out[OUTPUT_COUNT + PROBE_COUNT + 1];
    while (read_time() && read_row(in)) {
        drive(in);
        dut->START = 1;
        tick();
        // The module took its inputs at that edge: from now on they are noise.
        for (auto &word : in) word = ~word;
        drive(in);
        dut->START = 0;
        uint64_t cycles = 0;
        while (!dut->FINISH && cycles < limit) {
            tick();
            cycles++;
        }
        uint64_t *row = sample(out);
#define PROBE(expression) *row++ = dut->rootp->expression;
        PROBES
#undef PROBE
        *row++ = cycles < limit ? cycles : 0;
        fwrite(out, sizeof *out, OUTPUT_COUNT + PROBE_COUNT + 1, stdout);
    }
}
#endif

#ifdef READY
static bool offer(uint64_t limit) {
    uint64_t in[INPUT_COUNT + 1], out[OUTPUT_COUNT + PROBE_COUNT + 3], cycle = 0, busy = 0, number = -1;
    auto read = [&] { return number++, fread(in, sizeof *in, INPUT_COUNT + 1, stdin) == INPUT_COUNT + 1; };
    std::deque<std::pair<uint64_t, uint64_t>> taken;
    bool more = read();
    while (more || !taken.empty()) {
        if (more && in[0] == ~uint64_t(0)) {
            dut->START = 0;
            reset();
            taken.clear();
            more = read();
            continue;
        }
        bool offered = more && in[0] == 0;
        uint64_t noise[INPUT_COUNT + 1];
        for (int port = 0; port < INPUT_COUNT; port++) noise[port] = ~in[port + 1];
        drive(offered ? in + 1 : noise);
        dut->START = offered;
        dut->CLOCK = 0;
        dut->eval();
        bool takes = offered && dut->READY;
        if (dut->FINISH) {
            if (taken.empty()) return false;
            uint64_t *row = sample(out);
#define PROBE(expression) *row++ = dut->rootp->expression;
            PROBES
#undef PROBE
            *row++ = taken.front().first;
            *row++ = taken.front().second;
            *row++ = cycle - 1;
            taken.pop_front();
            fwrite(out, sizeof *out, row - out, stdout);
            busy = 0;
        }
        dut->CLOCK = 1;
        dut->eval();
        if (takes) {
            taken.emplace_back(number, cycle);
            more = read();
            busy = 0;
        } else if (more && in[0]) {
            in[0]--;
            if (taken.empty()) busy = 0;
        }
        if (++busy > limit) return false;
        cycle++;
    }
    return true;
}
#endif

int main(int argc, char **argv) {
#ifdef KEEP_WAVES
    Verilated::traceEverOn(true);
#endif
    dut = new MODEL_TYPE;
    static char buffer[1 << 16];
    setvbuf(stdout, buffer, _IOFBF, sizeof buffer);
#ifdef ENABLE
    dut->ENABLE = 1;
#endif
    fill();
    reset();
    if (argc == 2 && !strcmp(argv[1], "stream")) {
        stream();
#ifdef KEEP_WAVES
    } else if (argc == 4 && !strcmp(argv[1], "transact")) {
        open_waves(argv[3]);
        transact(strtoull(argv[2], nullptr, 10));
        waves->close();
#elif defined START
    } else if (argc == 3 && !strcmp(argv[1], "transact")) {
        transact(strtoull(argv[2], nullptr, 10));
#endif
#ifdef READY
    } else if (argc == 3 && !strcmp(argv[1], "offer")) {
        if (!offer(strtoull(argv[2], nullptr, 10))) return 3;
#endif
    } else {
        fprintf(stderr, "usage: %s stream | transact LIMIT | offer LIMIT\n", argv[0]);
        return 2;
    }
    dut->final();
    fflush(stdout);
    delete dut;
    return 0;
}
