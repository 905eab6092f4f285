// Runs modules with models of sensors and ADCs at their pins; drivers/pins.py talks to it and says what the macros are.
//
// Standard input: the number of actions, each a cycle, an input and a value, in order of the cycles; the number of
// cycles to run. Then the pixels of each line, when they are asked for.
// Standard output: records. A record has a kind, a number and a cycle, and then numbers of 64 bits with their count.
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "verilated.h"
#include "ports.h"

enum Kind : uint32_t { TRANSFER, SAMPLES, EVENT, BYTE, VIOLATION, MIDDLE };
static MODEL_TYPE *dut;
static uint64_t cycle;

static void record(Kind kind, uint32_t number, const uint64_t *words, uint64_t count) {
    struct { uint32_t kind, number; uint64_t cycle, count; } head{kind, number, cycle, count};
    fwrite(&head, sizeof head, 1, stdout);
    fwrite(words, sizeof *words, count, stdout);
}

static void read(void *words, size_t size, size_t count) {
    if (fread(words, size, count, stdin) != count) exit(3);
}

static void set(uint64_t index, uint64_t value) {
    uint64_t number = 0;
#define INPUT(port) if (number++ == index) dut->port = value;
    INPUTS
#undef INPUT
}

// One sensor and its ADC.
template <typename Words> struct Channel {
    uint32_t number;
    Words &image;
    uint32_t transfers = 0, samples = 0, violations[2] = {0, 0};
    // Samples of the ADC since the last event: cycle, slot of 16 bits, word of 12.
    std::vector<uint64_t> taken;

    void deliver() {
        record(SAMPLES, number, taken.data(), taken.size());
        taken.clear();
    }

    void transfer(uint32_t count, uint64_t opened, uint64_t closed) {
        transfers = count;
        uint64_t words[] = {count, opened, closed};
        record(TRANSFER, number, words, 3);
        fflush(stdout);
        static uint16_t pixels[PIXELS];
        read(pixels, sizeof *pixels, PIXELS);
        for (int i = 0; i < PIXELS; i++) image[i] = pixels[i];
    }

    void violated(int place, uint32_t count, uint64_t rules) {
        uint64_t words[] = {rules, count - violations[place]};
        violations[place] = count;
        record(VIOLATION, 2 * place + number, words, 2);
    }
};

#define WATCH(channel, side)                                                                                    \
    if (dut->transfers_##side != channel.transfers)                                                             \
        channel.transfer(dut->transfers_##side, dut->opened_##side, dut->closed_##side);                        \
    if (dut->samples_##side != channel.samples) {                                                               \
        channel.samples = dut->samples_##side;                                                                  \
        channel.taken.push_back(cycle << 28 | uint64_t(dut->slot_##side) << 12 | dut->word_##side);     \
    }                                                                                                           \
    if (dut->ccd_violations_##side != channel.violations[0])                                                    \
        channel.violated(0, dut->ccd_violations_##side, dut->ccd_violated_##side);                              \
    if (dut->adc_violations_##side != channel.violations[1])                                                    \
        channel.violated(1, dut->adc_violations_##side, dut->adc_violated_##side);

int main() {
    dut = new MODEL_TYPE;
    static char buffer[1 << 16];
    setvbuf(stdout, buffer, _IOFBF, sizeof buffer);
    auto &image_r = dut->rootp->IMAGE_R;
    auto &image_p = dut->rootp->IMAGE_P;
    Channel<std::remove_reference_t<decltype(image_r)>> roll{0, image_r};
    Channel<std::remove_reference_t<decltype(image_p)>> pitch{1, image_p};

    uint64_t count, cycles;
    read(&count, sizeof count, 1);
    std::vector<uint64_t> actions(3 * count + 1);
    read(actions.data(), 3 * sizeof count, count);
    actions[3 * count] = ~uint64_t(0);
    read(&cycles, sizeof cycles, 1);
    const uint64_t *next = actions.data();

    bool before = false, marked = false;
    // The receiver of the serial line: the state counts cycles until the middle of the next bit.
    uint64_t wait = 0;
    uint32_t bits = 0, byte = 0;
    for (cycle = 0; cycle < cycles; cycle++) {
        for (; *next == cycle; next += 3) set(next[1], next[2]);
        Verilated::time(cycle * PERIOD_PS);
        dut->clk = 0;
        dut->eval();
        Verilated::time(cycle * PERIOD_PS + PERIOD_PS / 2);
        dut->clk = 1;
        dut->eval();
        WATCH(roll, r)
        WATCH(pitch, p)
#ifdef EVENT_PORT
        if (dut->EVENT_PORT && !(EVENT_RISES && before)) {
            uint64_t out[OUTPUT_COUNT + 1], *row = out;
#define OUTPUT(port) *row++ = dut->port;
            OUTPUTS
#undef OUTPUT
            roll.deliver();
            pitch.deliver();
            record(EVENT, 0, out, OUTPUT_COUNT);
        }
        before = dut->EVENT_PORT;
#endif
#ifdef MIDDLE_PORT
        if (dut->MIDDLE_PORT && !marked) record(MIDDLE, 0, nullptr, 0);
        marked = dut->MIDDLE_PORT;
#endif
#ifdef UART_PORT
        if (wait) {
            if (--wait == 0) {
                // Bit 0 is the start bit, bit 9 the stop bit.
                byte |= uint32_t(dut->UART_PORT) << bits;
                if (++bits < 10) wait = UART_DIVISOR;
                else record(BYTE, byte, nullptr, 0);
            }
        } else if (!dut->UART_PORT) {
            wait = UART_DIVISOR / 2;
            bits = byte = 0;
        }
#endif
    }
    dut->final();
    fflush(stdout);
    delete dut;
    return 0;
}
