/* Each error of the driver, on registers that are memory. Ends with 0 if all are as described. */
#include <assert.h>

#include "strapdown.h"
#include CORE_HEADER

#define AT(name) registers[offsetof(struct strapdown_registers, name) / sizeof(uint32_t)]

int main(void)
{
    static const struct strapdown_map map = CORE_MAP;
    static uint32_t registers[sizeof(struct strapdown_registers) / sizeof(uint32_t)];
    uint32_t words[256] = {0};
    struct strapdown core;
    struct strapdown_update update;

    assert(strapdown_open(&core, &map, registers) == STRAPDOWN_NO_CORE);
    AT(identity) = STRAPDOWN_REGISTERS_IDENTITY_VALUE;
    assert(strapdown_open(&core, &map, registers) == STRAPDOWN_VERSION);
    AT(version) = STRAPDOWN_REGISTERS_VERSION_VALUE + 1u;
    AT(configuration) = map.configuration ^ 1u;
    assert(strapdown_open(&core, &map, registers) == STRAPDOWN_CONFIGURATION);
    AT(configuration) = map.configuration;
    assert(strapdown_open(&core, &map, registers) == STRAPDOWN_OK);
    AT(version) += 0x10000u;
    assert(strapdown_open(&core, &map, registers) == STRAPDOWN_VERSION);

    AT(status) = STRAPDOWN_REGISTERS_STATUS_BUSY_MASK;
    assert(strapdown_start(&core, words) == STRAPDOWN_BUSY);
    AT(status) = 0;
    AT(control) = map.stream;
    assert(strapdown_start(&core, words) == STRAPDOWN_BUSY);
    assert(AT(control) == map.stream);
    AT(control) = 0;
    AT(updates) = 0xFFFFFFFFu;
    words[map.sample_words - 1] = 77;
    assert(strapdown_start(&core, words) == STRAPDOWN_OK);
    assert(AT(control) == STRAPDOWN_REGISTERS_CONTROL_START_MASK);
    assert(registers[map.samples / 4u + map.sample_words - 1u] == 77);
    assert(strapdown_wait(&core, 3) == STRAPDOWN_TIMEOUT);
    AT(updates) = 0;
    assert(strapdown_wait(&core, 0) == STRAPDOWN_TIMEOUT);
    assert(strapdown_wait(&core, 1) == STRAPDOWN_OK);

    AT(snapshot_status) = map.refused;
    assert(strapdown_read(&core, words, &update) == STRAPDOWN_REFUSED);
    AT(snapshot_status) = ~map.refused;
    assert(strapdown_read(&core, words, &update) == STRAPDOWN_OK);
    assert(update.status == ~map.refused);

    AT(interrupt_flags) = 7;
    strapdown_enable(&core, 5);
    assert(strapdown_interrupt(&core) == 5);
    assert(AT(interrupt_flags) == 5); /* what was written to clear */

    assert(strapdown_select(&core, map.channels ? map.channels : 1u) == STRAPDOWN_CHANNEL);
    assert(strapdown_select(&core, map.channels ? map.channels - 1u : 0u) == STRAPDOWN_OK);
    assert(!map.channels || registers[map.channel / 4u] == map.channels - 1u);

    strapdown_reset(&core);
    assert(AT(control) & STRAPDOWN_REGISTERS_CONTROL_CORE_RESET_MASK);
    return 0;
}
