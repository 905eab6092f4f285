/* Stands in for the kernel behind /dev/uio0: its calls go to functions of this file, by --wrap of the linker. The registers
 * are the page that traps, and the interrupt is that of the circuit. */
#include "kernel.h"

#include <poll.h>
#include <stdarg.h>
#include <string.h>
#include <sys/mman.h>

#include "pipe.h"
#include "strapdown.h"

enum { DEVICE = 1000, CYCLES = 20000 };

static strapdown_bus page;
static int file, opened, enabled;

strapdown_bus connect_core(int argc, char **argv);
int __real_open(const char *path, int flags);
void *__real_mmap(void *address, size_t size, int protection, int flags, int number, off_t offset);
int __real_munmap(void *address, size_t size);
ssize_t __real_write(int number, const void *data, size_t size);
ssize_t __real_read(int number, void *data, size_t size);
int __real_close(int number);
int __wrap_open(const char *path, int flags, ...);
void *__wrap_mmap(void *address, size_t size, int protection, int flags, int number, off_t offset);
int __wrap_munmap(void *address, size_t size);
ssize_t __wrap_write(int number, const void *data, size_t size);
ssize_t __wrap_read(int number, void *data, size_t size);
int __wrap_poll(struct pollfd *wait, nfds_t count, int milliseconds);
int __wrap_close(int number);

int __wrap_open(const char *path, int flags, ...)
{
    if (strcmp(path, "/dev/uio0")) return __real_open(path, flags);
    opened++;
    return DEVICE;
}

void *__wrap_mmap(void *address, size_t size, int protection, int flags, int number, off_t offset)
{
    if (number != DEVICE) return __real_mmap(address, size, protection, flags, number, offset);
    return size == 4096 && protection == (PROT_READ | PROT_WRITE) && flags == MAP_SHARED && offset == 0
        ? (void *)(uintptr_t)page : MAP_FAILED;
}

int __wrap_munmap(void *address, size_t size)
{
    return address == (void *)(uintptr_t)page ? 0 : __real_munmap(address, size);
}

ssize_t __wrap_write(int number, const void *data, size_t size)
{
    uint32_t word;
    if (number != DEVICE) return __real_write(number, data, size);
    memcpy(&word, data, sizeof word);
    enabled = word == 1;
    return (ssize_t)size;
}

ssize_t __wrap_read(int number, void *data, size_t size)
{
    static uint32_t count;
    if (number != DEVICE) return __real_read(number, data, size);
    enabled = 0;
    count++;
    memcpy(data, &count, sizeof count);
    return (ssize_t)size;
}

int __wrap_poll(struct pollfd *wait, nfds_t count, int milliseconds)
{
    if (count != 1 || wait->fd != DEVICE || wait->events != POLLIN || milliseconds <= 0) exit(8);
    return enabled && ask(file, 'I', 0, CYCLES).code;
}

int __wrap_close(int number)
{
    if (number != DEVICE) return __real_close(number);
    opened--;
    return 0;
}

void boot(int argc, char **argv)
{
    file = argc == 2 ? atoi(argv[1]) : 0;
    page = connect_core(argc, argv);
}

int open_devices(void)
{
    return opened;
}
