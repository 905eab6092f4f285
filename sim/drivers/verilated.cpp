// Runs one Verilated module over rows of stimulus. The generated ports.h names the module, its
// clock and reset, and lists its ports; rows are little-endian 64-bit words, one a port.
//
//   MODEL stream    each row is one clock cycle; the answer holds the outputs in that cycle,
//                   before its closing edge
//   MODEL transact LIMIT
//                   each row is one START..FINISH transaction; the answer holds the outputs when
//                   FINISH has risen, the probes, and the cycles it took (0: not within LIMIT)
//
// Stimulus comes in on standard input, answers go out on standard output as they arise.
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "verilated.h"
#include "ports.h"

static MODEL_TYPE *dut;

static void tick() {
    dut->CLOCK = 0;
    dut->eval();
    dut->CLOCK = 1;
    dut->eval();
}

static void reset() {
#ifdef RESET
    dut->RESET = RESET_ACTIVE;
    for (int cycle = 0; cycle < 3; cycle++) tick();
    dut->RESET = !RESET_ACTIVE;
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
    while (read_row(in)) {
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

int main(int argc, char **argv) {
    dut = new MODEL_TYPE;
    static char buffer[1 << 16];
    setvbuf(stdout, buffer, _IOFBF, sizeof buffer);
    reset();
    if (argc == 2 && !strcmp(argv[1], "stream")) {
        stream();
#ifdef START
    } else if (argc == 3 && !strcmp(argv[1], "transact")) {
        transact(strtoull(argv[2], nullptr, 10));
#endif
    } else {
        fprintf(stderr, "usage: %s stream | transact LIMIT\n", argv[0]);
        return 2;
    }
    dut->final();
    fflush(stdout);
    delete dut;
    return 0;
}
