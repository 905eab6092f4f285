/* Driver of a strapdown core behind its bus. The functions are described in strapdown.h. */
#include "strapdown.h"

#define OFFSET(name) ((uint32_t)offsetof(struct strapdown_registers, name))
#define MASK(name) STRAPDOWN_REGISTERS_##name##_MASK
#define VALUE(name) STRAPDOWN_REGISTERS_##name##_VALUE

static uint32_t get(const struct strapdown *core, uint32_t offset)
{
#ifdef STRAPDOWN_HOOKS
    return strapdown_hook_read(core->bus, offset);
#else
    return core->bus[offset / sizeof(uint32_t)];
#endif
}

static void put(const struct strapdown *core, uint32_t offset, uint32_t word)
{
#ifdef STRAPDOWN_HOOKS
    strapdown_hook_write(core->bus, offset, word);
#else
    core->bus[offset / sizeof(uint32_t)] = word;
#endif
}

/* Gives a command; the stream stays on or off. */
static void command(const struct strapdown *core, uint32_t mask)
{
    put(core, OFFSET(control), get(core, OFFSET(control)) | mask);
}

static void put_words(const struct strapdown *core, uint32_t offset, uint32_t count, const uint32_t *words)
{
    while (count--) {
        put(core, offset, *words++);
        offset += (uint32_t)sizeof *words;
    }
}

int strapdown_open(struct strapdown *core, const struct strapdown_map *map, strapdown_bus bus)
{
    core->bus = bus;
    core->map = map;
    core->updates = 0;
    if (get(core, OFFSET(identity)) != VALUE(IDENTITY)) return STRAPDOWN_NO_CORE;
    /* The lower half of the version counts additions, which do no harm. */
    if ((get(core, OFFSET(version)) ^ VALUE(VERSION)) >> 16) return STRAPDOWN_VERSION;
    if (get(core, OFFSET(configuration)) != map->configuration) return STRAPDOWN_CONFIGURATION;
    return STRAPDOWN_OK;
}

void strapdown_reset(const struct strapdown *core)
{
    command(core, MASK(CONTROL_CORE_RESET));
}

void strapdown_parameters(const struct strapdown *core, const uint32_t *words)
{
    put_words(core, core->map->parameters, core->map->parameter_words, words);
}

int strapdown_select(const struct strapdown *core, uint32_t channel)
{
    if (channel >= core->map->channels) return channel ? STRAPDOWN_CHANNEL : STRAPDOWN_OK;
    put(core, core->map->channel, channel);
    return STRAPDOWN_OK;
}

int strapdown_start(struct strapdown *core, const uint32_t *sample)
{
    const struct strapdown_map *map = core->map;
    if (get(core, OFFSET(control)) & map->stream || get(core, OFFSET(status)) & MASK(STATUS_BUSY)) return STRAPDOWN_BUSY;
    core->updates = get(core, OFFSET(updates));
    put_words(core, map->samples, map->sample_words, sample);
    command(core, MASK(CONTROL_START));
    return STRAPDOWN_OK;
}

int strapdown_wait(const struct strapdown *core, uint32_t polls)
{
    while (polls--)
        if (get(core, OFFSET(updates)) != core->updates) return STRAPDOWN_OK;
    return STRAPDOWN_TIMEOUT;
}

int strapdown_read(const struct strapdown *core, uint32_t *words, struct strapdown_update *update)
{
    const struct strapdown_map *map = core->map;
    uint32_t offset = map->outputs, count = map->output_words;
    command(core, MASK(CONTROL_SNAPSHOT));
    update->number = get(core, OFFSET(snapshot_update));
    update->status = get(core, OFFSET(snapshot_status));
    update->channel = map->channels ? get(core, map->snapshot_channel) : 0;
    while (count--) {
        *words++ = get(core, offset);
        offset += (uint32_t)sizeof *words;
    }
    return update->status & map->refused ? STRAPDOWN_REFUSED : STRAPDOWN_OK;
}

void strapdown_enable(const struct strapdown *core, uint32_t mask)
{
    put(core, OFFSET(interrupt_enable), mask);
}

uint32_t strapdown_interrupt(const struct strapdown *core)
{
    uint32_t flags = get(core, OFFSET(interrupt_flags)) & get(core, OFFSET(interrupt_enable));
    put(core, OFFSET(interrupt_flags), flags);
    return flags;
}
