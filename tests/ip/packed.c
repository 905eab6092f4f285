/* A driver with the mistake that trap.c must find: it stores through a packed structure, so by bytes. */
#include "strapdown.h"
#include CORE_HEADER

struct __attribute__((packed)) packed_registers {
    struct strapdown_registers registers;
};

strapdown_bus connect_core(int argc, char **argv);

int main(int argc, char **argv)
{
    static const struct strapdown_map map = CORE_MAP;
    volatile struct packed_registers *core = (volatile void *)connect_core(argc, argv);
    core->registers.scratch = map.configuration;
    return 0;
}
