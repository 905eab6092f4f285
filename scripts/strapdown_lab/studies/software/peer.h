/* What a filter offers to the harness. All numbers are binary32, as in the circuits. */
#ifdef __cplusplus
extern "C" {
#endif

/* A sample: gyro (3, deg/s), specific force (3, g), field (3, any unit), magnitude of the specific force (g).
   The magnitude is for Betaflight, which takes it in the task of the accelerometer. */
enum { SAMPLE = 10 };

/* The attitude is level and to the north, and samples come with this period in seconds. */
void peer_start(float period);

/* The update that is timed. */
void peer_update(const float *sample);

/* The attitude as a unit quaternion, scalar first, sensor to earth. */
void peer_attitude(float *quaternion);

#ifdef __cplusplus
}
#endif
