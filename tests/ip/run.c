/* Runs the driver over samples, of one channel after the other. Words of the parameters, and of samples, come in on
 * standard input; for each sample the words of the outputs,
 * the number and the status of the update, the result of each function, and the flags of the interrupt go out on standard
 * output. The first word out is the result of open. connect_core, of another file, gives the bus. */
#include <stdio.h>

#include "strapdown.h"
#include CORE_HEADER

enum { MOST_WORDS = 256, POLLS = 100000 };

strapdown_bus connect_core(int argc, char **argv);

int main(int argc, char **argv)
{
    static const struct strapdown_map map = CORE_MAP;
    static uint32_t sample[MOST_WORDS], outputs[MOST_WORDS];
    struct strapdown core;
    struct strapdown_update update;
    uint32_t channel;
    int32_t result = strapdown_open(&core, &map, connect_core(argc, argv));
    fwrite(&result, sizeof result, 1, stdout);
    if (result != STRAPDOWN_OK) return 1;
    if (map.parameter_words) {
        if (fread(sample, sizeof *sample, map.parameter_words, stdin) != map.parameter_words) return 2;
        strapdown_parameters(&core, sample);
    }
    channel = 0;
    strapdown_enable(&core, STRAPDOWN_REGISTERS_INTERRUPT_ENABLE_FINISH_MASK |
                            STRAPDOWN_REGISTERS_INTERRUPT_ENABLE_REFUSED_MASK);
    while (fread(sample, sizeof *sample, map.sample_words, stdin) == map.sample_words) {
        int32_t results[3];
        uint32_t flags;
        if (map.channels && strapdown_select(&core, channel++ % map.channels) != STRAPDOWN_OK) return 3;
        results[0] = strapdown_start(&core, sample);
        results[1] = strapdown_wait(&core, POLLS);
        flags = strapdown_interrupt(&core);
        results[2] = strapdown_read(&core, outputs, &update);
        if (map.channels && update.channel != (channel - 1) % map.channels) return 4;
        fwrite(outputs, sizeof *outputs, map.output_words, stdout);
        fwrite(&update.number, sizeof update.number, 1, stdout);
        fwrite(&update.status, sizeof update.status, 1, stdout);
        fwrite(results, sizeof results, 1, stdout);
        fwrite(&flags, sizeof flags, 1, stdout);
    }
    return 0;
}
