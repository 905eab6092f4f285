// Upsets the registers of one Verilated core, lets it settle, and looks at its next update. ports.h is that of
// verilated.cpp, with the registers and memories and their widths.
//
//   MODEL LIMIT SETTLE
//                   each row is a seed, a number of cycles, how much to upset (0: one bit, 1: one register, 2: all
//                   registers; 3: these and all memories, before a reset), the number of the register (~0: any), whether
//                   starts go on after the upset, and two samples. After a reset, starts come at random with either
//                   sample for so many cycles; then comes the upset, and SETTLE cycles pass. The answer holds the probes
//                   and outputs with the second sample at the inputs, the cycles until it is taken, those of its update
//                   (0: not within LIMIT), and the outputs after it
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <vector>

#include "verilated.h"
#include "ports.h"

static MODEL_TYPE *dut;
static std::mt19937_64 generator;

static void tick() {
    dut->CLOCK = 0;
    dut->eval();
    dut->CLOCK = 1;
    dut->eval();
}

static void drive(const uint64_t *row) {
#define INPUT(port) dut->port = *row++;
    INPUTS
#undef INPUT
    dut->CLOCK = 0;
    dut->eval();
}

static uint64_t *sample(uint64_t *row) {
#define OUTPUT(port) *row++ = dut->port;
    OUTPUTS
#undef OUTPUT
    return row;
}

static void random_start(const uint64_t *first, const uint64_t *second) {
    uint64_t random = generator();
    drive(random & 1 ? first : second);
    dut->START = random >> 1 & 1;
    tick();
}

static bool ready() {
#ifdef READY
    return dut->READY;
#else
    return true;
#endif
}

// The last input is the channel, if there are several.
static bool finished(uint64_t channel) {
#ifdef READY
    return dut->FINISH && dut->out_channel == channel;
#else
    return dut->FINISH;
#endif
}

// A register as words of 32 bits or as one number.
template <class T> static void upset(T &value, int width, int bit) {
    uint64_t mask = width < 64 ? (uint64_t(1) << width) - 1 : ~uint64_t(0);
    value = (bit < 0 ? generator() : value ^ uint64_t(1) << bit) & mask;
}

template <std::size_t N> static void upset(VlWide<N> &value, int width, int bit) {
    for (int word = 0; word < int(N); word++) {
        uint32_t mask = width >= 32 * (word + 1) ? ~uint32_t(0) : (uint32_t(1) << (width - 32 * word)) - 1;
        if (bit < 0) value[word] = generator() & mask;
        else if (bit / 32 == word) value[word] ^= uint32_t(1) << bit % 32;
    }
}

static void upset(int kind, int chosen) {
    int bits = 0, count = 0;
#define REGISTER(expression, width)               \
    if (chosen < 0 || chosen == count) bits += width; \
    count++;
    REGISTERS
#undef REGISTER
    int bit = generator() % bits, number = chosen < 0 ? generator() % count : chosen, place = 0;
#define REGISTER(expression, width)                                                            \
    if (kind == 2 || (kind == 1 && number == place)) upset(dut->rootp->expression, width, -1);      \
    if (chosen < 0 || chosen == place) {                                                       \
        if (kind == 0 && bit >= 0 && bit < width) upset(dut->rootp->expression, width, bit);    \
        bit -= width;                                                                          \
    }                                                                                          \
    place++;
    REGISTERS
#undef REGISTER
}

static void power_up() {
    upset(2, -1);
#define MEMORY(expression, width) \
    for (auto &word : dut->rootp->expression.m_storage) upset(word, width, -1);
    MEMORIES
#undef MEMORY
}

static void reset() {
    dut->RESET = RESET_ACTIVE;
    for (int cycle = 0; cycle < 3; cycle++) tick();
    dut->RESET = !RESET_ACTIVE;
}

int main(int argc, char **argv) {
    if (argc != 3) return 2;
    uint64_t limit = strtoull(argv[1], nullptr, 10), settle = strtoull(argv[2], nullptr, 10);
    dut = new MODEL_TYPE;
    dut->eval();
    constexpr int columns = 5 + 2 * INPUT_COUNT;
    uint64_t row[columns], out[PROBE_COUNT + 2 * OUTPUT_COUNT + 2];
    const uint64_t *first = row + 5, *second = first + INPUT_COUNT;
    while (fread(row, sizeof *row, columns, stdin) == columns) {
        generator.seed(row[0]);
        dut->START = 0;
        reset();
        for (uint64_t cycle = 0; cycle < row[1]; cycle++) random_start(first, second);
        dut->START = 0;
        if (row[2] == 3) {
            power_up();
            reset();
        } else {
            upset(row[2], row[3]);
        }
        // The fourth edge after a reset may take a start.
        for (uint64_t cycle = 0; cycle < (row[2] == 3 ? 3 : settle); cycle++) {
            if (row[4]) random_start(first, second);
            else tick();
        }
        dut->START = 0;
        drive(second);
        uint64_t waited = 0;
        for (; !ready() && waited < limit; waited++) {
            tick();
            drive(second);
        }
        uint64_t *next = out;
#define PROBE(expression) *next++ = dut->rootp->expression;
        PROBES
#undef PROBE
        next = sample(next);
        dut->START = 1;
        dut->eval();
        *next++ = waited;
        tick();
        dut->START = 0;
        // The core took its inputs at that edge: from now on they are those of the other sample.
        drive(first);
        uint64_t cycles = 0;
        while (!finished(row[columns - 1]) && cycles < limit) {
            tick();
            cycles++;
        }
        *next++ = cycles < limit ? cycles : 0;
        next = sample(next);
        fwrite(out, sizeof *out, next - out, stdout);
    }
    dut->final();
    fflush(stdout);
    delete dut;
    return 0;
}
