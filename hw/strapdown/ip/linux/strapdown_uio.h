/* Driver of a strapdown core on Linux: its registers and its interrupt through /dev/uio, for uio_pdrv_genirq. */
#ifndef STRAPDOWN_UIO_H
#define STRAPDOWN_UIO_H

#include "strapdown.h"

/* A core behind a device. core is for the functions of strapdown.h. */
struct strapdown_uio {
    struct strapdown core;
    int file;
};

/* Opens a device as /dev/uio0, and the core as strapdown_open. SYSTEM, and as strapdown_open; then nothing is open. */
int strapdown_uio_open(struct strapdown_uio *device, const char *path, const struct strapdown_map *map);

/* Waits for an interrupt, at most for a time, and handles it: flags as of strapdown_interrupt. TIMEOUT, SYSTEM. */
int strapdown_uio_interrupt(const struct strapdown_uio *device, int milliseconds, uint32_t *flags);

/* Closes the device. */
void strapdown_uio_close(struct strapdown_uio *device);

#endif /* STRAPDOWN_UIO_H */
