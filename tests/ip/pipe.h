/* Reads and writes of the model behind its pipe, whose requests and answers sim/strapdown_sim/drivers/bus.cpp tells. */
#ifndef PIPE_H
#define PIPE_H

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

struct request {
    uint8_t operation, strobes;
    uint16_t half;
    uint32_t word;
};

struct answer {
    uint32_t code, word;
};

static inline struct answer ask(int file, char operation, uint32_t half, uint32_t word)
{
    struct request request = {(uint8_t)operation, 0xF, (uint16_t)half, word};
    struct answer answer;
    if (write(file, &request, sizeof request) != (ssize_t)sizeof request ||
        read(file, &answer, sizeof answer) != (ssize_t)sizeof answer) {
        fputs("the model ended\n", stderr);
        exit(3);
    }
    return answer;
}

static inline uint32_t transact(int file, char operation, uint32_t address, uint32_t word)
{
    struct answer answer = ask(file, operation, address, word);
    if (answer.code) {
        fprintf(stderr, "%c %03x: error answer\n", operation, (unsigned)address);
        exit(4);
    }
    return answer.word;
}

#endif
