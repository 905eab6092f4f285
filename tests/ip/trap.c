/* The bus of the driver on an ARM: a page without access. Each load and store to it traps, is decoded (ARM DDI 0406C,
 * A6.3, A8.8), and goes through the pipe. The driver under test is an object that knows nothing of this. Anything but a
 * load or store of a whole word ends the program with status 5. The numbers of loads and stores go out at the end. */
#define _GNU_SOURCE
#include <signal.h>
#include <string.h>
#include <sys/mman.h>
#include <ucontext.h>

#include "pipe.h"
#include "strapdown.h"

enum { THUMB = 1 << 5, PC = 15 };

/* Address of the core in the example design. */
static void *const address_of_core = (void *)0x43C00000;

static int file;
static uint8_t *page;
static unsigned long loads, stores;

strapdown_bus connect_core(int argc, char **argv);

/* What a load or store of a word does beside the transfer. */
struct access {
    unsigned load, target, size, base, writeback;
    int32_t step; /* of the base register */
};

static int decode_thumb(const uint16_t *code, struct access *access)
{
    unsigned first = code[0], second;
    access->size = 2;
    access->target = first & 7u;
    if ((first & 0xF000u) == 0x6000u || (first & 0xF600u) == 0x5000u) { /* immediate; register: 0x50 STR, 0x58 LDR */
        access->load = first >> 11 & 1u;
        return 1;
    }
    if ((first & 0xFF60u) != 0xF840u) return 0;
    second = code[1];
    access->size = 4;
    access->load = first >> 4 & 1u;
    access->base = first & 15u;
    access->target = second >> 12;
    if (first & 0x80u || !(second & 0xFC0u)) return 1; /* 12 bits of offset; a register */
    if (!(second & 0x800u)) return 0;
    access->writeback = second >> 8 & 1u;
    access->step = (int32_t)(second & 255u) * (second & 0x200u ? 1 : -1);
    return 1;
}

static int decode_arm(uint32_t code, struct access *access)
{
    access->size = 4;
    access->load = code >> 20 & 1u;
    access->base = code >> 16 & 15u;
    access->target = code >> 12 & 15u;
    access->writeback = !(code & 1u << 24) || code & 1u << 21;
    access->step = (int32_t)(code & 0xFFFu) * (code & 1u << 23 ? 1 : -1);
    if ((code & 0x0E400000u) == 0x04000000u) return 1;                                /* immediate, not a byte */
    return (code & 0x0E400010u) == 0x06000000u && !access->writeback;                 /* register */
}

/* The conditions of an IT block, in bits 26:25 and 15:10 of the status, go on to the next instruction. */
static unsigned long next_condition(unsigned long status)
{
    unsigned long state = (status >> 25 & 3u) | (status >> 8 & 0xFCu);
    state = state & 7u ? (state & 0xE0u) | (state << 1 & 0x1Fu) : 0;
    return (status & ~0x0600FC00ul) | (state & 3u) << 25 | (state & 0xFCu) << 8;
}

static void refuse(const char *why, unsigned long address, uint32_t code)
{
    fprintf(stderr, "refused: %s, code %08x, register %03lx\n", why, (unsigned)code, address);
    _exit(5);
}

static void trapped(int signal_number, siginfo_t *info, void *context)
{
    mcontext_t *machine = &((ucontext_t *)context)->uc_mcontext;
    unsigned long *registers = &machine->arm_r0;
    unsigned long address = (unsigned long)((uint8_t *)info->si_addr - page);
    struct access access = {0};
    int whole;
    uint32_t code;
    (void)signal_number;
    if (address >= sizeof(struct strapdown_registers)) {
        fprintf(stderr, "a fault outside the registers, at %p\n", info->si_addr);
        _exit(6);
    }
    memcpy(&code, (const void *)machine->arm_pc, sizeof code);
    if (machine->arm_cpsr & THUMB) {
        uint16_t halves[2];
        memcpy(halves, &code, sizeof halves);
        whole = decode_thumb(halves, &access);
    } else
        whole = decode_arm(code, &access);
    if (!whole || access.target == PC) refuse("not a load or store of a word", address, code);
    if (address & 3u) refuse("not at the address of a word", address, code);
    if (access.load) {
        registers[access.target] = transact(file, 'R', (uint32_t)address, 0);
        loads++;
    } else {
        (void)transact(file, 'W', (uint32_t)address, (uint32_t)registers[access.target]);
        stores++;
    }
    if (access.writeback) registers[access.base] += (unsigned long)access.step;
    machine->arm_pc += access.size;
    machine->arm_cpsr = next_condition(machine->arm_cpsr);
}

static void tell(void)
{
    fprintf(stderr, "%lu loads, %lu stores\n", loads, stores);
}

strapdown_bus connect_core(int argc, char **argv)
{
    struct sigaction action;
    file = argc == 2 ? atoi(argv[1]) : 0;
    page = mmap(address_of_core, sizeof(struct strapdown_registers), PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (page != address_of_core) exit(7);
    memset(&action, 0, sizeof action);
    action.sa_sigaction = trapped;
    action.sa_flags = SA_SIGINFO;
    if (sigaction(SIGSEGV, &action, NULL) || atexit(tell)) exit(7);
    return (strapdown_bus)(void *)page;
}
