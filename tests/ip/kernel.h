/* The stand-in for the kernel. */
#ifndef KERNEL_H
#define KERNEL_H

void boot(int argc, char **argv);
int open_devices(void);

#endif
