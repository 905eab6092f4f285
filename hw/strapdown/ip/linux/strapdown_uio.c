/* Driver of a strapdown core on Linux. The functions are described in strapdown_uio.h. */
#include "strapdown_uio.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/mman.h>
#include <unistd.h>

#define SIZE sizeof(struct strapdown_registers)

int strapdown_uio_open(struct strapdown_uio *device, const char *path, const struct strapdown_map *map)
{
    void *page;
    int result;
    device->file = open(path, O_RDWR | O_SYNC);
    if (device->file < 0) return STRAPDOWN_SYSTEM;
    page = mmap(0, SIZE, PROT_READ | PROT_WRITE, MAP_SHARED, device->file, 0);
    if (page == MAP_FAILED) {
        (void)close(device->file);
        return STRAPDOWN_SYSTEM;
    }
    result = strapdown_open(&device->core, map, (strapdown_bus)page);
    if (result != STRAPDOWN_OK) strapdown_uio_close(device);
    return result;
}

int strapdown_uio_interrupt(const struct strapdown_uio *device, int milliseconds, uint32_t *flags)
{
    struct pollfd wait = {device->file, POLLIN, 0};
    uint32_t word = 1;
    int count;
    /* The kernel disables the interrupt each time that it comes. */
    if (write(device->file, &word, sizeof word) != (ssize_t)sizeof word) return STRAPDOWN_SYSTEM;
    count = poll(&wait, 1, milliseconds);
    if (count == 0) return STRAPDOWN_TIMEOUT;
    if (count < 0 || read(device->file, &word, sizeof word) != (ssize_t)sizeof word) return STRAPDOWN_SYSTEM;
    *flags = strapdown_interrupt(&device->core);
    return STRAPDOWN_OK;
}

void strapdown_uio_close(struct strapdown_uio *device)
{
    (void)munmap((void *)(uintptr_t)device->core.bus, SIZE);
    (void)close(device->file);
}
