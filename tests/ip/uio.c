/* Runs the driver for /dev/uio over samples, as run.c runs the other one, by interrupts: for each sample the words of the
 * outputs and the status go out. kernel.c is the kernel. Each way in which it can fail has a status. */
#include <stdio.h>

#include "kernel.h"
#include "strapdown_uio.h"
#include CORE_HEADER

enum { MOST_WORDS = 256 };

int main(int argc, char **argv)
{
    static const struct strapdown_map map = CORE_MAP;
    static uint32_t sample[MOST_WORDS], outputs[MOST_WORDS];
    struct strapdown_map other = map;
    struct strapdown_uio device;
    struct strapdown_update update;
    uint32_t flags;
    boot(argc, argv);
    other.configuration++;
    if (strapdown_uio_open(&device, "/dev/uio-none", &map) != STRAPDOWN_SYSTEM) return 9;
    if (strapdown_uio_open(&device, "/dev/uio0", &other) != STRAPDOWN_CONFIGURATION || open_devices()) return 10;
    if (strapdown_uio_open(&device, "/dev/uio0", &map) != STRAPDOWN_OK) return 11;
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
    return open_devices();
}
