// A Verilated core behind AXI4-Lite and AXI4-Stream, driven through a pipe. The generated ports.h names the module and
// tells which ports it has.
//
//   MODEL SEED STALLS
//                   STALLS is the percentage of cycles in which a side of a channel that could act waits. Each request
//                   on standard input has one answer on standard output, in order. Both have eight bytes, in
//                   little-endian order; a request has an operation, byte strobes, a half-word, and a word; an answer
//                   has a code and a word:
//
//   'R' read        half-word: address. Answer: response, data
//   'W' write       half-word: address; word: data; strobes. Answer: response, 0
//   'N' wait        word: cycles. Answer: irq, and words that wait to be sent << 1; number of this cycle
//   'I' interrupt   word: most cycles until irq is high. Answer: irq, number of this cycle
//   'S' send        word: data of a word of the sample stream; half-word: 1 for TLAST, and TID << 1. It goes in while
//                   the clock runs, which is during all other operations. Answer: words that wait, 0
//   'G' get         word: most cycles until there is a word of the answer stream. Answer: 1 for a word, TLAST << 1,
//                   TID << 2; its data. The stream is ready during this operation only
//   'Z' reset       word: cycles. Answer: 0, number of this cycle
//
// In each cycle the rules of AXI for the outputs are checked: an offer stays as it is until it is taken; there is an
// answer to each access and no other; no output depends on an input of the same cycle; a reset ends all offers. If one
// is broken, the process prints which and ends with status 3.
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>

#include "verilated.h"
#include "ports.h"

struct Request { uint8_t operation, strobes; uint16_t half; uint32_t word; };
struct Answer { uint32_t code, word; };
struct Word { uint32_t data; bool last; uint32_t id; };

static const uint64_t PATIENCE = 10000;  // cycles in which an access must end
static MODEL_TYPE *dut;
static uint64_t cycle, random_state;
static unsigned stalls;
static bool resetting;

static bool stalled() {  // xorshift64*
    random_state ^= random_state >> 12;
    random_state ^= random_state << 25;
    random_state ^= random_state >> 27;
    return (random_state * 0x2545F4914F6CDD1DULL >> 33) % 100 < stalls;
}

[[noreturn]] static void broken(const char *rule) {
    fflush(stdout);
    fprintf(stderr, "cycle %llu: %s\n", (unsigned long long)cycle, rule);
    exit(3);
}

// The outputs of a cycle. Payloads count only while they are offered.
struct Outputs {
    uint64_t awready, wready, bvalid, bresp, arready, rvalid, rdata, rresp, irq, tready, tvalid, tdata, tlast, tid;
    bool operator==(const Outputs &other) const { return !memcmp(this, &other, sizeof *this); }
};

static Outputs sample() {
    Outputs now{};
    now.awready = dut->s_axi_awready;
    now.wready = dut->s_axi_wready;
    now.bvalid = dut->s_axi_bvalid;
    now.bresp = now.bvalid ? dut->s_axi_bresp : 0;
    now.arready = dut->s_axi_arready;
    now.rvalid = dut->s_axi_rvalid;
    now.rdata = now.rvalid ? dut->s_axi_rdata : 0;
    now.rresp = now.rvalid ? dut->s_axi_rresp : 0;
    now.irq = dut->irq;
#ifdef STREAMS
    now.tready = dut->s_axis_tready;
    now.tvalid = dut->m_axis_tvalid;
    now.tdata = now.tvalid ? dut->m_axis_tdata : 0;
    now.tlast = now.tvalid ? dut->m_axis_tlast : 0;
#ifdef CHANNELS
    now.tid = now.tvalid ? dut->m_axis_tid : 0;
#endif
#endif
    return now;
}

static Outputs before;  // after the last edge, with the inputs of the cycle before
static std::deque<Word> samples, answers;
static bool wanted;  // a word of the answer stream
static uint32_t reads, writes, write_addresses;  // taken, and not answered

// One cycle with the inputs that are set; those of the streams are set here.
static Outputs tick() {
#ifdef STREAMS
    // An offer must stay, so only the start of one may wait.
    if (!dut->s_axis_tvalid && !samples.empty() && !resetting && !stalled()) {
        dut->s_axis_tvalid = 1;
        dut->s_axis_tdata = samples.front().data;
        dut->s_axis_tlast = samples.front().last;
#ifdef CHANNELS
        dut->s_axis_tid = samples.front().id;
#endif
    }
    dut->m_axis_tready = wanted && !resetting && !stalled();
#endif
    dut->CLOCK = 0;
    dut->eval();
    Outputs now = sample();
    if (cycle && !(now == before)) broken("an output depends on an input of the same cycle");
    if (now.bresp & 1 || now.rresp & 1) broken("a response is neither OKAY nor SLVERR");
    if (now.bvalid && !(writes && write_addresses)) broken("an answer to no write");
    if (now.rvalid && !reads) broken("an answer to no read");
    // An aresetn that is low acts at the edge of this cycle.
    bool address = dut->s_axi_awvalid && now.awready, data = dut->s_axi_wvalid && now.wready;
    bool answer = now.bvalid && dut->s_axi_bready, read = dut->s_axi_arvalid && now.arready;
    bool result = now.rvalid && dut->s_axi_rready, sent = false, got = false;
#ifdef STREAMS
    sent = dut->s_axis_tvalid && now.tready;
    got = now.tvalid && dut->m_axis_tready;
#endif
    dut->CLOCK = 1;
    dut->eval();
    cycle++;
    before = sample();
    if (resetting) {
        reads = writes = write_addresses = 0;
        if (before.bvalid || before.rvalid || before.tvalid) broken("an offer during a reset");
        return now;
    }
    write_addresses += address - answer;
    writes += data - answer;
    reads += read - result;
    if (now.bvalid && !answer && !(before.bvalid && before.bresp == now.bresp))
        broken("an answer to a write did not stay");
    if (now.rvalid && !result && !(before.rvalid && before.rdata == now.rdata && before.rresp == now.rresp))
        broken("an answer to a read did not stay");
    if (now.tvalid && !got && !(before.tvalid && before.tdata == now.tdata && before.tlast == now.tlast &&
                                before.tid == now.tid))
        broken("a word of the answer stream did not stay");
#ifdef STREAMS
    if (sent) {
        samples.pop_front();
        dut->s_axis_tvalid = 0;
    }
#endif
    if (got) answers.push_back({(uint32_t)now.tdata, now.tlast != 0, (uint32_t)now.tid});
    return now;
}

static Answer write(const Request &request) {
    bool address = false, data = false;
    dut->s_axi_awaddr = request.half;
    dut->s_axi_wdata = request.word;
    dut->s_axi_wstrb = request.strobes;
    for (uint64_t limit = cycle + PATIENCE; cycle < limit;) {
        dut->s_axi_awvalid |= !address && !stalled();
        dut->s_axi_wvalid |= !data && !stalled();
        dut->s_axi_bready = !stalled();
        Outputs now = tick();
        if (dut->s_axi_awvalid && now.awready) address = true, dut->s_axi_awvalid = 0;
        if (dut->s_axi_wvalid && now.wready) data = true, dut->s_axi_wvalid = 0;
        if (now.bvalid && dut->s_axi_bready) {
            dut->s_axi_bready = 0;
            return {(uint32_t)now.bresp, 0};
        }
    }
    broken("no answer to a write");
}

static Answer read(const Request &request) {
    bool address = false;
    dut->s_axi_araddr = request.half;
    for (uint64_t limit = cycle + PATIENCE; cycle < limit;) {
        dut->s_axi_arvalid |= !address && !stalled();
        dut->s_axi_rready = !stalled();
        Outputs now = tick();
        if (dut->s_axi_arvalid && now.arready) address = true, dut->s_axi_arvalid = 0;
        if (now.rvalid && dut->s_axi_rready) {
            dut->s_axi_rready = 0;
            return {(uint32_t)now.rresp, (uint32_t)now.rdata};
        }
    }
    broken("no answer to a read");
}

static Answer reset(uint64_t cycles) {
    dut->RESET = RESET_ACTIVE;
    resetting = true;
    dut->s_axi_awvalid = dut->s_axi_wvalid = dut->s_axi_bready = dut->s_axi_arvalid = dut->s_axi_rready = 0;
#ifdef STREAMS
    dut->s_axis_tvalid = 0;
#endif
    samples.clear();
    answers.clear();
    while (cycles--) tick();
    dut->RESET = !RESET_ACTIVE;
    resetting = false;
    return {0, (uint32_t)cycle};
}

static Answer get(uint64_t limit) {
    wanted = true;
    while (answers.empty() && limit--) tick();
    wanted = false;
    if (answers.empty()) return {0, 0};
    Word word = answers.front();
    answers.pop_front();
    return {1u | word.last << 1 | word.id << 2, word.data};
}

static Answer serve(const Request &request) {
    uint64_t count = request.word;
    switch (request.operation) {
    case 'R': return read(request);
    case 'W': return write(request);
    case 'N':
        while (count--) tick();
        return {(uint32_t)dut->irq | (uint32_t)samples.size() << 1, (uint32_t)cycle};
    case 'I':
        while (!dut->irq && count--) tick();
        return {(uint32_t)dut->irq, (uint32_t)cycle};
    case 'S':
        samples.push_back({request.word, (request.half & 1) != 0, (uint32_t)request.half >> 1});
        return {(uint32_t)samples.size(), 0};
    case 'G': return get(count);
    case 'Z': return reset(count);
    }
    fprintf(stderr, "unknown operation %d\n", request.operation);
    exit(2);
}

// Fills a request; what was answered goes out before this process waits.
static bool next(Request &request) {
    static char buffer[1 << 16];
    static ssize_t begin, end;
    while (end - begin < (ssize_t)sizeof request) {
        memmove(buffer, buffer + begin, end - begin);
        end -= begin;
        begin = 0;
        fflush(stdout);
        ssize_t count = ::read(0, buffer + end, sizeof buffer - end);
        if (count <= 0) return false;
        end += count;
    }
    memcpy(&request, buffer + begin, sizeof request);
    begin += sizeof request;
    return true;
}

int main(int argc, char **argv) {
    if (argc != 3) {
        fprintf(stderr, "usage: %s SEED STALLS\n", argv[0]);
        return 2;
    }
    random_state = strtoull(argv[1], nullptr, 10) * 2 + 1;
    stalls = strtoul(argv[2], nullptr, 10);
    dut = new MODEL_TYPE;
    reset(3);
    Request request;
    while (next(request)) {
        Answer answer = serve(request);
        fwrite(&answer, sizeof answer, 1, stdout);
    }
    dut->final();
    delete dut;
    return 0;
}
