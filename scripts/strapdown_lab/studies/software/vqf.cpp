/* VQF in single precision: earth frame ENU. */
#include <cmath>
#include "vqf.hpp"
#include "peer.h"

static VQF *filter;
static float now[4];

void peer_start(float period)
{
  filter = new VQF(period);
}

void peer_update(const float *sample)
{
  float gyro[3], force[3];
  for (int k = 0; k < 3; ++k) {
    gyro[k] = sample[k] * float(M_PI / 180);
    force[k] = sample[3 + k] * 9.80665f;
  }
  filter->update(gyro, force, sample + 6);
  filter->getQuat9D(now);
}

void peer_attitude(float *quaternion)
{
  for (int k = 0; k < 4; ++k) quaternion[k] = now[k];
}
