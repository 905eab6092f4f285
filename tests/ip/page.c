/* What the programs of docs/software.md lack: sensors, a display, and a core. Samples come in on standard input, and angles
 * go out on standard output. */
#include <stdio.h>
#include <stdlib.h>

#include "INS_top_axi.h"
#include "kernel.h"

void read_sensors(union INS_top_axi_sample *sample);
void show(float pitch, float roll, float yaw);

__attribute__((constructor)) static void before_main(int argc, char **argv)
{
    boot(argc, argv);
}

void read_sensors(union INS_top_axi_sample *sample)
{
    if (fread(sample, sizeof *sample, 1, stdin) != 1) exit(0);
}

void show(float pitch, float roll, float yaw)
{
    float angles[3];
    angles[0] = pitch;
    angles[1] = roll;
    angles[2] = yaw;
    fwrite(angles, sizeof angles, 1, stdout);
}
