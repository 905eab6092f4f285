// Runs Verilated copies of an operator with one 32-bit operand over a range of operands. It compares every
// result with an expectation that it computes with the host's arithmetic or with integers. The generated
// ports.h names the module, and each copy's operand and result. All copies are started together.
//
//   MODEL EXPECTATION FLUSH LATENCY INTERVAL FIRST COUNT
//
// FLUSH is 1 if subnormals count as zeros; COUNT is a multiple of the number of copies. Prints a line "operand got
// wanted" in hexadecimal for each of the first ten mismatches, then a line with the number of mismatches. Status 3: done
// came in a wrong cycle.
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "verilated.h"
#include "ports.h"

static const uint32_t SIGN = 0x80000000u, INFINITE = 0x7f800000u, QUIET = 0x7fc00000u, LEAST_NORMAL = 0x00800000u;

static float number(uint32_t bits) {
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static uint32_t encoding(float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return value != value ? QUIET : bits;
}

// IEEE 754 requires the host's square root and conversion to be correctly rounded, to nearest even.
static uint32_t square_root(uint32_t bits, uint32_t) { return encoding(sqrtf(number(bits))); }

static uint32_t from_int32(uint32_t bits, uint32_t) { return encoding(float(int32_t(bits))); }

// A finite positive number as significand * 2**exponent, the significand at least 2**23.
static uint64_t significand(uint32_t bits, int *exponent) {
    uint64_t value = bits & (LEAST_NORMAL - 1);
    *exponent = int(bits >> 23) - 150;
    if (bits >= LEAST_NORMAL) return value | LEAST_NORMAL;
    for (*exponent = -149; value < LEAST_NORMAL; (*exponent)--) value <<= 1;
    return value;
}

// In integers: the greatest r with (2r - 1)**2 * x <= 2**(2n + 2), so r is 2**n / sqrt(x) rounded to nearest.
static uint32_t reciprocal_square_root(uint32_t bits, uint32_t) {
    uint32_t size = bits & ~SIGN;
    if (size > INFINITE) return QUIET;
    if (size == 0) return INFINITE | bits;
    if (bits & SIGN) return QUIET;
    if (size == INFINITE) return 0;
    int exponent;
    unsigned __int128 x = significand(bits, &exponent);
    if (exponent & 1) x <<= 1, exponent--;
    // x is between 2**23 and 2**25, hence 2**36 / sqrt(x) between 2**23.5 and 2**24.5: two scales.
    int n = x > (1u << 24) ? 36 : 35;
    unsigned __int128 limit = (unsigned __int128)1 << (2 * n + 2);
    uint64_t r = uint64_t(std::ldexp(1 / std::sqrt(double(x)), n));
    while ((unsigned __int128)(2 * r + 1) * (2 * r + 1) * x <= limit) r++;
    while ((unsigned __int128)(2 * r - 1) * (2 * r - 1) * x > limit) r--;
    // r * 2**(-n - exponent / 2). Ties do not occur: a tie would have more bits than a power of four gives.
    return encoding(float(std::ldexp(double(r), -n - exponent / 2)));
}

// ``got`` if it is within the bound of FpTableReciprocal of the exact value, else the value rounded to nearest. The exact
// value has 64 significant bits. Results below the least normal number are zero.
static uint32_t near(long double exact, uint32_t got) {
    const long double error = std::fabs(number(got) - exact);
    if (error <= 0.88L * std::ldexp(1.0L, std::ilogb(exact) - 23)) return got;
    return std::fabs(exact) < number(LEAST_NORMAL) ? std::signbit(exact) ? SIGN : 0 : encoding(float(exact));
}

static uint32_t table_reciprocal(uint32_t bits, uint32_t got) {
    uint32_t size = bits & ~SIGN;
    if (size > INFINITE) return QUIET;
    if (size == 0 || size == INFINITE) return (bits & SIGN) | (INFINITE - size);
    return near(1 / (long double)number(bits), got);
}

static uint32_t table_reciprocal_square_root(uint32_t bits, uint32_t got) {
    uint32_t size = bits & ~SIGN;
    if (size == 0 || size >= INFINITE || bits & SIGN) return reciprocal_square_root(bits, got);
    return near(1 / std::sqrt((long double)number(bits)), got);
}

// In integers: magnitude * 2**fraction_bits, cut off, and a comparison of the rest with one half.
static uint32_t to_fixed(uint32_t bits, int width, int fraction_bits) {
    const uint64_t largest = (uint64_t(1) << (width - 1)) - 1;
    uint32_t size = bits & ~SIGN, mask = uint32_t((largest << 1) | 1);
    if (size > INFINITE) return uint32_t(largest);
    bool negative = bits & SIGN;
    uint64_t end = largest + negative, magnitude = end;
    if (size < INFINITE && size != 0) {
        int exponent;
        uint64_t value = significand(size, &exponent);
        exponent += fraction_bits;
        if (exponent < -30) {
            magnitude = 0;
        } else if (exponent < 0) {
            uint64_t unit = uint64_t(1) << -exponent, rest = value & (unit - 1);
            magnitude = value >> -exponent;
            if (2 * rest > unit || (2 * rest == unit && (magnitude & 1))) magnitude++;
        } else if (exponent < 40) {
            magnitude = value << exponent;
        }
    } else if (size == 0) {
        magnitude = 0;
    }
    if (magnitude > end) magnitude = end;
    return uint32_t(negative ? -magnitude : magnitude) & mask;
}

static uint32_t to_int32(uint32_t bits, uint32_t) { return to_fixed(bits, 32, 0); }
static uint32_t to_fixed16(uint32_t bits, uint32_t) { return to_fixed(bits, 16, 14); }

static const struct {
    const char *name;
    uint32_t (*function)(uint32_t operand, uint32_t got);
    bool takes_float, gives_float;
} EXPECTATIONS[] = {
    {"square_root", square_root, true, true},
    {"reciprocal_square_root", reciprocal_square_root, true, true},
    {"table_reciprocal", table_reciprocal, true, true},
    {"table_reciprocal_square_root", table_reciprocal_square_root, true, true},
    {"to_int32", to_int32, true, false},
    {"to_fixed16", to_fixed16, true, false},
    {"from_int32", from_int32, false, true},
};

static uint32_t flushed(uint32_t bits) { return (bits & ~SIGN) < LEAST_NORMAL ? bits & SIGN : bits; }

int main(int argc, char **argv) {
    const uint64_t lanes = INPUT_COUNT;
    if (argc != 7 || strtoull(argv[6], nullptr, 0) % lanes) return 2;
    const auto *expectation = EXPECTATIONS;
    for (; strcmp(expectation->name, argv[1]); expectation++)
        if (expectation + 1 == EXPECTATIONS + sizeof EXPECTATIONS / sizeof *EXPECTATIONS) return 2;
    const bool flush = atoi(argv[2]);
    const uint64_t latency = strtoull(argv[3], nullptr, 0), interval = strtoull(argv[4], nullptr, 0);
    const uint64_t first = strtoull(argv[5], nullptr, 0), count = strtoull(argv[6], nullptr, 0);

    auto *dut = new MODEL_TYPE;
    dut->RESET = RESET_ACTIVE;
    for (int edge = 0; edge < 6; edge++) dut->CLOCK = edge & 1, dut->eval();
    dut->RESET = !RESET_ACTIVE;

    uint64_t mismatches = 0;
    const uint64_t cycles = (count / lanes - 1) * interval + latency + 1;
    for (uint64_t cycle = 0, given = 0, taken = 0, next_start = 0, next_done = latency; cycle < cycles; cycle++) {
        dut->START = cycle == next_start && given < count;
        // Between the starts operands are noise.
        uint64_t operand = dut->START ? first + given : ~(first + given);
#define INPUT(port) dut->port = uint32_t(operand++);
        INPUTS
#undef INPUT
        if (dut->START) given += lanes, next_start += interval;
        dut->CLOCK = 0;
        dut->eval();
        if (dut->FINISH != (cycle == next_done ? (1u << lanes) - 1 : 0)) {
            printf("done is %x in cycle %llu\n", dut->FINISH, (unsigned long long)cycle);
            return 3;
        }
        if (dut->FINISH) {
            next_done += interval;
            const uint32_t results[] = {
#define OUTPUT(port) uint32_t(dut->port),
                OUTPUTS
#undef OUTPUT
            };
            for (uint32_t got : results) {
                const uint32_t operand = uint32_t(first + taken++);
                uint32_t wanted = expectation->function(flush && expectation->takes_float ? flushed(operand) : operand,
                                                        got);
                if (flush && expectation->gives_float) wanted = flushed(wanted);
                if (got != wanted && mismatches++ < 10) printf("%08x %08x %08x\n", operand, got, wanted);
            }
        }
        dut->CLOCK = 1;
        dut->eval();
    }
    printf("%llu\n", (unsigned long long)mismatches);
    delete dut;
    return 0;
}
