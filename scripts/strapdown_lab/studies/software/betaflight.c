/* Betaflight's attitude task, armed, with magnetometer and without GPS: earth frame NWU. The firmware's own test of the
   task replaces the rest of the firmware in the same way. */
#include <stdbool.h>
#include "platform.h"
#include "build/debug.h"
#include "fc/runtime_config.h"
#include "flight/imu.h"
#include "io/gps.h"
#include "sensors/acceleration.h"
#include "sensors/compass.h"
#include "sensors/gyro.h"
#include "sensors/sensors.h"
#include "peer.h"

acc_t acc;
mag_t mag;
gpsSolutionData_t gpsSol;
uint8_t debugMode, stateFlags, armingFlags;
int16_t debug[DEBUG16_VALUE_COUNT];
uint16_t flightModeFlags;

extern const imuConfig_t pgResetTemplate_imuConfig;

static const float *gyro_now;
static timeUs_t now;
static timeUs_t period_us;

bool sensors(uint32_t mask) { return mask & (SENSOR_ACC | SENSOR_MAG); }
bool compassIsHealthy(void) { return true; }
bool isFixedWing(void) { return false; }
float gpsRescueGetImuYawCogGain(void) { return 1; }
float getRcDeflectionAbs(int axis) { (void)axis; return 0; }
float gyroGetFilteredDownsampled(int axis) { return gyro_now[axis]; }
void mixerSetThrottleAngleCorrection(int correction) { (void)correction; }
void schedulerIgnoreTaskStateTime(void) {}

void peer_start(float period)
{
  period_us = 1e6f * period;
  armingFlags = ARMED;
  acc.isAccelUpdatedAtLeastOnce = true;
  *imuConfigMutable() = pgResetTemplate_imuConfig;
  imuConfigure(0, 0);
  imuInit();
}

void peer_update(const float *sample)
{
  now += period_us;
  gyro_now = sample;
  acc.accADC = (vector3_t){{sample[3], sample[4], sample[5]}};
  acc.accMagnitude = sample[9];
  mag.magADC = (vector3_t){{sample[6], sample[7], sample[8]}};
  imuUpdateAttitude(now);
}

void peer_attitude(float *quaternion)
{
  quaternion_t found;
  getQuaternion(&found);
  for (int k = 0; k < 4; ++k) quaternion[k] = found.v[k];
}
