/* The bus of the driver as functions that go through the pipe. */
#include "pipe.h"
#include "strapdown.h"

static int file;

strapdown_bus connect_core(int argc, char **argv);

strapdown_bus connect_core(int argc, char **argv)
{
    file = argc == 2 ? atoi(argv[1]) : 0;
    return &file;
}

uint32_t strapdown_hook_read(strapdown_bus bus, uint32_t offset)
{
    return transact(*(int *)bus, 'R', offset, 0);
}

void strapdown_hook_write(strapdown_bus bus, uint32_t offset, uint32_t word)
{
    (void)transact(*(int *)bus, 'W', offset, word);
}
