/* Runs the driver for /dev/uio over samples, as run.c runs the other one, by interrupts. The calls of the operating system
 * for the device go to functions of this file: the registers are the page that traps, and the interrupt is that of the
 * circuit. The first words out are the results of a wait that ends with its time, and of one after an update. */
#include <poll.h>
#include <stdarg.h>
#include <string.h>
#include <sys/mman.h>

#include "pipe.h"
#include "strapdown_uio.h"
#include CORE_HEADER

enum { DEVICE = 1000, MOST_WORDS = 256, CYCLES = 20000 };

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
    if (strcmp(path, "/dev/uio7")) return __real_open(path, flags);
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
    if (count != 1 || wait->fd != DEVICE || wait->events != POLLIN || milliseconds != 20) exit(8);
    return enabled && ask(file, 'I', 0, CYCLES).code;
}

int __wrap_close(int number)
{
    if (number != DEVICE) return __real_close(number);
    opened--;
    return 0;
}

int main(int argc, char **argv)
{
    static const struct strapdown_map map = CORE_MAP;
    static uint32_t sample[MOST_WORDS], outputs[MOST_WORDS];
    struct strapdown_map other = map;
    struct strapdown_uio device;
    struct strapdown_update update;
    uint32_t flags;
    file = argc == 2 ? atoi(argv[1]) : 0;
    page = connect_core(argc, argv);
    other.configuration++;
    if (strapdown_uio_open(&device, "/dev/uio-none", &map) != STRAPDOWN_SYSTEM) return 9;
    if (strapdown_uio_open(&device, "/dev/uio7", &other) != STRAPDOWN_CONFIGURATION || opened) return 10;
    if (strapdown_uio_open(&device, "/dev/uio7", &map) != STRAPDOWN_OK) return 11;
    strapdown_enable(&device.core, STRAPDOWN_REGISTERS_INTERRUPT_ENABLE_FINISH_MASK);
    if (strapdown_uio_interrupt(&device, 20, &flags) != STRAPDOWN_TIMEOUT) return 12;
    while (fread(sample, sizeof *sample, map.sample_words, stdin) == map.sample_words) {
        if (strapdown_start(&device.core, sample) != STRAPDOWN_OK) return 13;
        if (strapdown_uio_interrupt(&device, 20, &flags) != STRAPDOWN_OK) return 14;
        if (flags != STRAPDOWN_REGISTERS_INTERRUPT_FLAGS_FINISH_MASK) return 15;
        (void)strapdown_read(&device.core, outputs, &update);
        fwrite(outputs, sizeof *outputs, map.output_words, stdout);
        fwrite(&update.status, sizeof update.status, 1, stdout);
    }
    strapdown_uio_close(&device);
    return opened;
}
