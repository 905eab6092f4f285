/* Times the updates of a filter on a core of this machine: bench SAMPLES PERIOD PASSES.

   SAMPLES is a file of binary32 numbers, SAMPLE for each update, and PERIOD is in seconds. The filter takes the samples
   PASSES times, without a restart. The samples of a pass are cut into batches of equal size. The time of a batch is the
   least of all passes, so what else runs on the machine does not count; the time of an update is the mean over all
   batches. The same is done with a function that does nothing. Each update waits for the one before it, as in a
   vehicle, because it needs its attitude.

   Prints JSON: the time of an update with the call and without, in ns, and the attitude after the first pass. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include "peer.h"

enum { BATCH = 256 };

static __attribute__((noinline)) void nothing(const float *sample)
{
  __asm__ volatile("" : : "r"(sample) : "memory");
}

static __attribute__((noinline)) double batch(void (*step)(const float *), const float *sample, long count)
{
  struct timespec before, after;
  clock_gettime(CLOCK_MONOTONIC, &before);
  for (long k = 0; k < count; ++k) step(sample + k * SAMPLE);
  clock_gettime(CLOCK_MONOTONIC, &after);
  return (after.tv_sec - before.tv_sec) * 1e9 + (after.tv_nsec - before.tv_nsec);
}

static void keep_least(double *least, double time)
{
  if (*least == 0 || time < *least) *least = time;
}

int main(int argc, char **argv)
{
  if (argc != 4) return 2;
  FILE *file = fopen(argv[1], "rb");
  if (!file) { perror(argv[1]); return 1; }
  fseek(file, 0, SEEK_END);
  long count = ftell(file) / (long)(SAMPLE * sizeof(float)), batches = (count + BATCH - 1) / BATCH;
  rewind(file);
  float *samples = malloc(count * SAMPLE * sizeof(float) + 1), quaternion[4] = {0};
  double (*least)[2] = calloc(batches + 1, sizeof *least), total[2] = {0};
  if (!samples || !least || fread(samples, SAMPLE * sizeof(float), count, file) != (size_t)count) return 1;
  fclose(file);

  peer_start(strtof(argv[2], NULL));
  for (long pass = 0, passes = atol(argv[3]); pass < passes; ++pass) {
    for (long k = 0; k < batches; ++k) {
      long first = k * BATCH, size = count - first < BATCH ? count - first : BATCH;
      keep_least(&least[k][0], batch(peer_update, samples + first * SAMPLE, size));
      keep_least(&least[k][1], batch(nothing, samples + first * SAMPLE, size));
    }
    if (pass == 0) peer_attitude(quaternion);
  }
  for (long k = 0; k < batches; ++k)
    for (int which = 0; which < 2; ++which) total[which] += least[k][which] / count;
  printf("{\"call_ns\": %.3f, \"update_ns\": %.3f, \"quaternion\": [%.9g, %.9g, %.9g, %.9g]}\n", total[0],
         total[0] - total[1], quaternion[0], quaternion[1], quaternion[2], quaternion[3]);
  return 0;
}
