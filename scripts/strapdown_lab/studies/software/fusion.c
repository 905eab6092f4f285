/* Fusion, the filter of S. Madgwick's thesis, chapter 7: earth frame NWU. With EULER, an update gives Euler angles too. */
#include <string.h>
#include "Fusion.h"
#include "peer.h"

static FusionAhrs ahrs;
FusionEuler euler;

void peer_start(float period)
{
  FusionAhrsSettings settings = fusionAhrsDefaultSettings;
  settings.sampleRate = 1 / period;
  FusionAhrsInitialise(&ahrs);
  FusionAhrsSetSettings(&ahrs, &settings);
}

void peer_update(const float *sample)
{
  FusionVector gyroscope, accelerometer, magnetometer;
  memcpy(&gyroscope, sample, sizeof gyroscope);
  memcpy(&accelerometer, sample + 3, sizeof accelerometer);
  memcpy(&magnetometer, sample + 6, sizeof magnetometer);
  FusionAhrsUpdate(&ahrs, gyroscope, accelerometer, magnetometer);
#ifdef EULER
  euler = FusionQuaternionToEuler(FusionAhrsGetQuaternion(&ahrs));
#endif
}

void peer_attitude(float *quaternion)
{
  FusionQuaternion found = FusionAhrsGetQuaternion(&ahrs);
  memcpy(quaternion, &found, sizeof found);
}
