/* Driver of a strapdown core behind its bus: C99, no heap, no library.
 *
 * One object drives any number of cores of any kind. What differs between them stands in a struct strapdown_map, which
 * the header of the core initialises: static const struct strapdown_map map = INS_TOP_AXI_MAP;
 *
 * The processor is little-endian. Registers are accessed as whole words: directly, at the address that open gets, or,
 * if STRAPDOWN_HOOKS is defined, by the functions strapdown_hook_read and strapdown_hook_write of the user.
 */
#ifndef STRAPDOWN_H
#define STRAPDOWN_H

#include <stdint.h>

#include "strapdown_registers.h"

/* Results. Errors are negative. */
enum {
    STRAPDOWN_OK = 0,
    STRAPDOWN_NO_CORE = -1,       /* there is no core at this address */
    STRAPDOWN_VERSION = -2,       /* its registers are laid out for another version of the driver */
    STRAPDOWN_CONFIGURATION = -3, /* it was generated with another configuration than the header */
    STRAPDOWN_BUSY = -4,          /* an update runs, or the samples come from the stream: nothing was started */
    STRAPDOWN_TIMEOUT = -5,       /* the update did not finish within the bound */
    STRAPDOWN_REFUSED = -6,       /* the update was refused: outputs and state are those of the one before */
    STRAPDOWN_CHANNEL = -7,       /* the core has no such channel */
    STRAPDOWN_SYSTEM = -8         /* the operating system does not permit it: errno tells why */
};

/* What differs between cores: offsets in bytes, and numbers of words. What a core lacks is zero. */
struct strapdown_map {
    uint32_t configuration; /* CRC-32 */
    uint32_t refused;       /* mask of the bit in the status */
    uint32_t stream;        /* mask of the bit in CONTROL */
    uint16_t samples, sample_words;
    uint16_t parameters, parameter_words;
    uint16_t outputs, output_words;
    uint16_t channels, channel, snapshot_channel; /* number, and offsets */
};

#ifdef STRAPDOWN_HOOKS
typedef void *strapdown_bus;
uint32_t strapdown_hook_read(strapdown_bus bus, uint32_t offset);
void strapdown_hook_write(strapdown_bus bus, uint32_t offset, uint32_t word);
#else
typedef volatile uint32_t *strapdown_bus;
#endif

/* A core. All members are the driver's. */
struct strapdown {
    strapdown_bus bus;
    const struct strapdown_map *map;
    uint32_t updates; /* finished updates before the last start */
};

/* What a snapshot holds beside the outputs. */
struct strapdown_update {
    uint32_t number; /* of the update since the reset of the core, modulo 2^32; 0 before the first */
    uint32_t status;
    uint32_t channel;
};

/* Checks identity, version and configuration. The core is as it was. NO_CORE, VERSION, CONFIGURATION. */
int strapdown_open(struct strapdown *core, const struct strapdown_map *map, strapdown_bus bus);

/* Resets the state of the core to that after power-up. Parameters and interrupts stay enabled as they are. */
void strapdown_reset(const struct strapdown *core);

/* Writes the parameters, the words of union NAME_parameters. They act from the next start. */
void strapdown_parameters(const struct strapdown *core, const uint32_t *words);

/* Selects the channel of the next starts. CHANNEL. */
int strapdown_select(const struct strapdown *core, uint32_t channel);

/* Starts an update with a sample, the words of union NAME_sample. BUSY. */
int strapdown_start(struct strapdown *core, const uint32_t *sample);

/* Waits for the end of the update that start began, and looks at most polls times. TIMEOUT. */
int strapdown_wait(const struct strapdown *core, uint32_t polls);

/* Reads the outputs of the last finished update, all of the same one, into the words of union NAME_outputs. REFUSED. */
int strapdown_read(const struct strapdown *core, uint32_t *words, struct strapdown_update *update);

/* Enables the interrupts of a mask of STRAPDOWN_REGISTERS_INTERRUPT_ENABLE_..._MASK, and disables the others. */
void strapdown_enable(const struct strapdown *core, uint32_t mask);

/* The interrupt handler: takes the enabled flags that are set, clears them, and returns them as the mask does. */
uint32_t strapdown_interrupt(const struct strapdown *core);

#endif /* STRAPDOWN_H */
