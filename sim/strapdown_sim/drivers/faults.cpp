// Flips single bits of one Verilated core while it works through samples, and judges what follows. ports.h is that of
// verilated.cpp, with the registers and memories, and how the outputs are compared.
//
//   MODEL SAMPLES LATENCY GAP SECOND HORIZON
//                   SAMPLES is a file of little-endian 64-bit words: a round of samples is one a channel, each a word an
//                   input. Each row of standard input is a number, the place, row and bit to flip, the round, and the
//                   time in the round, in 2^-32 of its length; rows are in the order of time. The answers are rows of the
//                   number, the outcome, whether a reset restores the core, the largest error in thousandths of the
//                   limit, and the rounds after the flip until this was known
//
// The core without a fault runs once through all samples, and its outputs and a sum of its state are kept. It runs a
// second time, and becomes two processes at each fault: the child flips the bit and goes on until its outcome is known.
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "verilated.h"
#include "ports.h"

enum Outcome { MASKED, TRANSIENT, WRONG_FLAGGED, WRONG_SILENT, STUCK, OUT_OF_STEP, DEAD_CHANNEL, HANG };

// Rounds after a reset in which the core must equal one without a fault.
constexpr int AFTER_RESET = 100;
// Rounds without any difference, but for the flipped bit, after which nothing reads it.
constexpr uint64_t QUIET = 64;
// Updates in a row that may be refused.
constexpr uint64_t REFUSED_ROUNDS = 8;
constexpr uint64_t NEVER = ~uint64_t(0);

// The word of a register or memory: a part of the model.
struct Word {
    void *at;
    uint8_t bytes;
    bool changes;

    uint64_t value() const {
        uint64_t value = 0;
        memcpy(&value, at, bytes);
        return value;
    }
    void flip(int bit) const { static_cast<uint8_t *>(at)[bit / 8] ^= 1 << bit % 8; }
};

// Words of a row of a place, and the number of its first word.
struct Place {
    size_t first, words;
};

struct Fault {
    uint64_t number, place, row, bit, round, time;
};

// One update of one channel: cycles from start to finish (0: none), whether a finish came that belongs to no sample, and
// the outputs, at the finish if they are valid only then.
struct Update {
    uint64_t cycles;
    uint64_t outputs[OUTPUT_COUNT];
    bool strange;
};

struct Round {
    Update updates[CHANNELS];
    uint64_t length, sum;
};

static MODEL_TYPE *dut;
static std::vector<Word> words;
static std::vector<Place> places;
static std::vector<uint64_t> samples;
static std::vector<Round> golden;
static std::vector<Fault> faults;
static uint64_t latency, gap, second, horizon;
// The round, the clock edges since it began, the next fault, and whether this process has flipped a bit.
static uint64_t now, offset;
static size_t next_fault;
static bool child;

// All words of the state.

template <class T> static void add(T &value, bool changes) { words.push_back({&value, sizeof value, changes}); }

template <size_t N> static void add(VlWide<N> &value, bool changes) {
    for (size_t word = 0; word < N; word++) words.push_back({&value[word], 4, changes});
}

template <class T, size_t N> static void add(VlUnpacked<T, N> &value, bool changes) {
    for (size_t row = 0; row < N; row++) add(value[row], changes);
}

static void find_words() {
    words.clear();
    places.clear();
    size_t first;
#define PLACE(expression, rows, changes) \
    first = words.size();                \
    add(dut->rootp->expression, changes); \
    places.push_back({first, (words.size() - first) / rows});
    PLACES
#undef PLACE
}

static uint64_t mixed(uint64_t value) {
    value ^= value >> 30;
    value *= 0xbf58476d1ce4e5b9;
    value ^= value >> 27;
    value *= 0x94d049bb133111eb;
    return value ^ value >> 31;
}

static uint64_t share(size_t word, uint64_t value) { return mixed(value + mixed(word + 0x9e3779b97f4a7c15)); }

// A sum over all words that can change: equal for equal states, and that of a word can be taken out.
static uint64_t state_sum() {
    uint64_t sum = 0;
    for (size_t word = 0; word < words.size(); word++)
        if (words[word].changes) sum += share(word, words[word].value());
    return sum;
}

// The core.

static void inject();

static void edge() {
    dut->CLOCK = 0;
    dut->eval();
    dut->CLOCK = 1;
    dut->eval();
}

static void power_up() {
    dut = new MODEL_TYPE;
#ifdef ENABLE
    dut->ENABLE = 1;
#endif
    dut->eval();
    find_words();
}

static void reset() {
    dut->START = 0;
    dut->RESET = RESET_ACTIVE;
    for (int cycle = 0; cycle < 3; cycle++) edge();
    dut->RESET = !RESET_ACTIVE;
    // It acts a little longer.
    for (int cycle = 0; cycle < 3; cycle++) edge();
}

// A port must not get more bits than it has.
static void drive(const uint64_t *row, uint64_t turned) {
    static const int widths[] = {INPUT_WIDTHS};
    const int *width = widths;
#define INPUT(port) dut->port = (*row++ ^ turned) & NEVER >> (64 - *width++);
    INPUTS
#undef INPUT
}

static void sample(uint64_t *row) {
#define OUTPUT(port) *row++ = dut->port;
    OUTPUTS
#undef OUTPUT
}

// One round: a sample for each channel, as soon as it is taken or too late, then the rest of the updates and a pause.
static Round run_round(uint64_t number) {
    Round round = {};
    uint64_t begun[CHANNELS];
    std::fill(begun, begun + CHANNELS, NEVER);
    bool finish = dut->FINISH;
    const uint64_t *row = &samples[number * CHANNELS * INPUT_COUNT];
    now = number;
    offset = 0;
    // Advances one cycle; returns whether a sample that is offered was taken.
    auto cycle = [&](bool offered) {
        dut->START = offered;
        dut->CLOCK = 0;
        dut->eval();
#ifdef READY
        bool taken = offered && dut->READY;
#endif
        dut->CLOCK = 1;
        dut->eval();
        offset++;
#ifdef READY
        // A pulse for each update.
        if (dut->FINISH) {
            uint64_t channel = dut->out_channel;
#else
        bool taken = offered && !dut->FINISH, rises = dut->FINISH && !finish;
        finish = dut->FINISH;
        if (rises) {
            uint64_t channel = 0;
#endif
            Update &update = round.updates[channel];
            if (begun[channel] == NEVER || update.cycles) update.strange = true;
            else update.cycles = offset - begun[channel];
            sample(update.outputs);
        }
        while (!child && next_fault < faults.size() && faults[next_fault].round == now && !golden.empty() &&
               1 + (faults[next_fault].time * golden[now].length >> 32) == offset)
            inject();
        return taken;
    };
    uint64_t limit = 2 * latency;
    for (int channel = 0; channel < CHANNELS; channel++, row += INPUT_COUNT) {
        bool taken = false;
        drive(row, 0);
#ifdef READY
        for (uint64_t waited = 0; !taken && waited < limit; waited++) taken = cycle(true);
#else
        taken = cycle(true);
#endif
        if (taken) begun[channel] = offset;
        // The core took its inputs at that edge: from now on they are noise.
        drive(row, NEVER);
    }
    for (int channel = 0; channel < CHANNELS; channel++)
        while (begun[channel] != NEVER && !round.updates[channel].cycles && offset - begun[channel] <= limit)
            cycle(false);
#ifndef READY
    // Without a start that was taken: until the next one.
    while (offset <= latency) cycle(false);
#endif
    for (uint64_t idle = 0; idle < gap; idle++) cycle(false);
#ifndef READY
    sample(round.updates[0].outputs);
#endif
    round.length = offset;
    round.sum = state_sum();
    return round;
}

// Errors, in parts of what is allowed.

static double number(uint64_t bits) {
    if (FORMAT_WIDTH == 64) {
        double value;
        memcpy(&value, &bits, sizeof value);
        return value;
    }
    float value;
    uint32_t low = bits;
    memcpy(&value, &low, sizeof value);
    return value;
}

static double distance(const double *a, const double *b, int count, double sign = 1) {
    double sum = 0;
    for (int index = 0; index < count; index++) sum += (a[index] - sign * b[index]) * (a[index] - sign * b[index]);
    return std::sqrt(sum);
}

constexpr double DEGREE = M_PI / 180, ANGLE_LIMIT = 0.01 * DEGREE, POSITION_LIMIT = 1, VELOCITY_LIMIT = 0.1;

static double angle_of(double half_chord) { return half_chord < 1 ? 2 * std::asin(half_chord) : M_PI; }

static double matrix_error(const double *a, const double *b) {
    return angle_of(distance(a, b, 9) / std::sqrt(8.0)) / ANGLE_LIMIT;
}

static void matrix_of(const double *degrees, double *matrix) {
    double p = degrees[0] * DEGREE, r = degrees[1] * DEGREE, y = degrees[2] * DEGREE;
    double cp = std::cos(p), sp = std::sin(p), cr = std::cos(r), sr = std::sin(r), cy = std::cos(y), sy = std::sin(y);
    const double found[9] = {cp * cy, cp * sy, -sp, sr * sp * cy - cr * sy, sr * sp * sy + cr * cy, sr * cp,
                             cr * sp * cy + sr * sy, cr * sp * sy - sr * cy, cr * cp};
    std::copy(found, found + 9, matrix);
}

// The angle between two attitudes given as pitch, roll and yaw.
static double angles_error(const double *a, const double *b) {
    double first[9], other[9];
    matrix_of(a, first);
    matrix_of(b, other);
    return matrix_error(first, other);
}

static double quaternion_error(const double *a, const double *b) {
    // q and -q are the same. A quaternion that is not of unit length may be farther away than any attitude.
    double angle = 2 * angle_of(std::min(distance(a, b, 4), distance(a, b, 4, -1)) / 2);
    return std::min(angle, M_PI) / ANGLE_LIMIT;
}

// Latitude and longitude, degrees, and height.
static double position_error(const double *a, const double *b) {
    constexpr double radius = 6378137;
    double north = (a[0] - b[0]) * DEGREE * radius, up = a[2] - b[2];
    double east = std::remainder(a[1] - b[1], 360) * DEGREE * radius * std::cos(b[0] * DEGREE);
    return std::sqrt(north * north + east * east + up * up) / POSITION_LIMIT;
}

static double velocity_error(const double *a, const double *b) { return distance(a, b, 3) / VELOCITY_LIMIT; }

static double error_of(const uint64_t *found, const uint64_t *right) {
    if (std::equal(right, right + OUTPUT_COUNT, found)) return 0;
    double largest = 0, a[9], b[9];
    // What is not a number is as wrong as can be.
#define MEASURE(kind, count, ...)                                         \
    {                                                                     \
        const int ports[] = {__VA_ARGS__};                                \
        for (int index = 0; index < count; index++) {                     \
            a[index] = number(found[ports[index]]);               \
            b[index] = number(right[ports[index]]);               \
        }                                                                 \
        double error = kind##_error(a, b);                                \
        largest = std::max(largest, std::isfinite(error) ? error : 1e15); \
    }
    MEASURES
#undef MEASURE
    return largest;
}

static uint64_t status_of(const Update &update) {
#ifdef STATUS
    return update.outputs[STATUS];
#else
    return 0;
#endif
}

// A child.

struct Judge {
    const Fault &fault;
    // The flipped word, and its contents before.
    const size_t word;
    const uint64_t before;
    bool visible = false, equal = false, told[CHANNELS] = {};
    uint64_t wrong[CHANNELS] = {}, refused[CHANNELS] = {}, quiet = 0, still = 0;
    double largest = 0;
    // What each channel showed last.
    uint64_t held[CHANNELS][OUTPUT_COUNT];

    Judge(const Fault &fault, size_t word) : fault(fault), word(word), before(words[word].value()) {
        for (int channel = 0; channel < CHANNELS; channel++) show(channel, golden[fault.round - 1].updates[channel]);
    }

    void show(int channel, const Update &update) {
        std::copy(update.outputs, update.outputs + OUTPUT_COUNT, held[channel]);
    }

    // What a round shows: an outcome, or -1 if it is not known yet.
    int after(uint64_t number, const Round &round) {
        const Round &right = golden[number];
        bool same = true, small = true, right_now = true, ran = false;
        int worst = -1;
        for (int channel = 0; channel < CHANNELS; channel++) ran |= round.updates[channel].cycles == latency;
        for (int channel = 0; channel < CHANNELS; channel++) {
            const Update &update = round.updates[channel], &wanted = right.updates[channel];
            bool late = update.cycles != wanted.cycles || update.strange;
            // The update of the fault and the next one may take other cycles.
            if (late && number > fault.round + 1)
                worst = std::max<int>(worst, update.cycles || update.strange ? OUT_OF_STEP
                                             : CHANNELS > 1 && ran ? DEAD_CHANNEL : HANG);
            uint64_t status = status_of(update), difference = status ^ status_of(wanted);
            // Of several channels, one whose update has no finish or is refused keeps its outputs in the receiver only.
            bool ended = CHANNELS == 1 || update.cycles;
            if (CHANNELS == 1 || (update.cycles && !(status & REFUSED_MASK))) show(channel, update);
            double error = error_of(held[channel], wanted.outputs);
            largest = std::max(largest, error);
            told[channel] |= ended && difference;
            visible |= late || (ended && difference) || error > 1;
            small &= !late && !difference && error < 0.1;
            same &= !late && !memcmp(update.outputs, wanted.outputs, sizeof update.outputs);
            wrong[channel] += error > 1;
            right_now &= error <= 1;
            bool again = ended && status & difference & REFUSED_MASK && !(status & RESTARTED_MASK);
            refused[channel] = again ? refused[channel] + 1 : 0;
            if (refused[channel] > REFUSED_ROUNDS) worst = std::max<int>(worst, STUCK);
            if (wrong[channel] > second)
                worst = std::max<int>(worst, told[channel] ? WRONG_FLAGGED : WRONG_SILENT);
        }
        if (worst >= 0) return worst;
        int harmless = visible ? TRANSIENT : MASKED;
        bool changes = words[word].changes;
        equal = changes && same && round.sum == right.sum;
        if (equal) return harmless;
        uint64_t rest = changes ? round.sum - share(word, words[word].value()) + share(word, before) : round.sum;
        quiet = same && rest == right.sum ? quiet + 1 : 0;
        still = small ? still + 1 : 0;
        bool over = number - fault.round > horizon + (right_now ? 0 : second);
        return quiet > QUIET || still > horizon / 4 || over ? harmless : -1;
    }
};

static bool restored() {
    reset();
    for (int number = 0; number < AFTER_RESET; number++) {
        Round round = run_round(number);
        for (int channel = 0; channel < CHANNELS; channel++) {
            const Update &update = round.updates[channel], &wanted = golden[number].updates[channel];
            if (update.cycles != wanted.cycles || update.strange ||
                memcmp(update.outputs, wanted.outputs, sizeof update.outputs))
                return false;
        }
    }
    return true;
}

// Declared here because Verilator's header does not: it settles all signals from the contents of the registers.
void SETTLE(ROOT_TYPE *);

static Judge *judge;

static void inject() {
    const Fault &fault = faults[next_fault++];
    fflush(stdout);
    pid_t process = fork();
    if (process < 0) exit(4);
    if (process) {
        int status;
        if (waitpid(process, &status, 0) != process || status) exit(4);
        return;
    }
    child = true;
    const Place &place = places[fault.place];
    size_t word = place.first + fault.row * place.words + (place.words > 1 ? fault.bit / 32 : 0);
    judge = new Judge(fault, word);
    words[word].flip(place.words > 1 ? fault.bit % 32 : fault.bit);
    SETTLE(dut->rootp);
}

// Goes on from the round of the fault, and writes the answer.
static void conclude(Round round) {
    uint64_t number = now;
    int outcome;
    while ((outcome = judge->after(number, round)) < 0) round = run_round(++number);
    uint64_t rounds = number - judge->fault.round;
    bool fine = judge->equal || restored();
    const uint64_t row[] = {judge->fault.number, uint64_t(outcome), fine,
                            uint64_t(std::min(1e15, 1e3 * judge->largest)), rounds};
    if (write(1, row, sizeof row) != sizeof row) _exit(4);
    _exit(0);
}

int main(int argc, char **argv) {
    if (argc != 6) return 2;
    latency = strtoull(argv[2], nullptr, 10);
    gap = strtoull(argv[3], nullptr, 10);
    second = strtoull(argv[4], nullptr, 10);
    horizon = strtoull(argv[5], nullptr, 10);
    FILE *file = fopen(argv[1], "rb");
    if (!file) return 2;
    uint64_t words_read[1024];
    for (size_t count; (count = fread(words_read, 8, 1024, file));)
        samples.insert(samples.end(), words_read, words_read + count);
    fclose(file);
    Fault fault;
    while (fread(&fault, sizeof fault, 1, stdin) == 1) faults.push_back(fault);
    power_up();
    reset();
    std::vector<Round> rounds;
    for (uint64_t number = 0; number < samples.size() / (CHANNELS * INPUT_COUNT); number++) {
        rounds.push_back(run_round(number));
        for (const Update &update : rounds.back().updates)
            if (update.cycles != latency || update.strange) return 3;
    }
    golden = std::move(rounds);
    power_up();
    reset();
    for (uint64_t number = 0; next_fault < faults.size(); number++) {
        Round round = run_round(number);
        if (child) conclude(round);
    }
    return 0;
}
