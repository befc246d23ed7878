/* SuperTac for C, and for every language that can call C: a trained model draws super-resolved tactile
   pictures, of windows that you have or of frames as a sensor gives them; and recordings train a model.

     supertac_model *model = supertac_open("model.safetensors", SUPERTAC_FP32);
     supertac_live *live = supertac_live_new(model, 300, 0);      // 300 frames/s, as the sensor gives them
     for each frame:
       supertac_live_push(live, time_s, frame);
       if (supertac_live_picture(live, picture, NULL) == 1) show(picture);

   Link with `pkg-config --cflags --libs supertac`, or find_package(supertac) and supertac::c. Functions that
   can fail return NULL or -1, and supertac_error() then says in one line what was wrong. Nothing is printed,
   and no exception leaves the library. In a child by fork() the thread that forked works alone.
   The pictures have the same bits as those of the programs, on every processor and with any number of
   threads. */
#ifndef SUPERTAC_H
#define SUPERTAC_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

#if defined(__GNUC__)
#define SUPERTAC_API __attribute__((visibility("default")))
#else
#define SUPERTAC_API
#endif

typedef struct supertac_model supertac_model; /* never changes: any number of threads may use one */
typedef struct supertac_live supertac_live;   /* one sensor; used by one thread at a time */

enum { SUPERTAC_FP32 = 0, SUPERTAC_INT8 = 1 };

typedef struct {
  size_t size;        /* set it to sizeof(supertac_description) before the call: later versions have more */
  int rows, columns;  /* of the array of taxels */
  int channels;       /* numbers that a taxel gives */
  int signals;        /* rows * columns * channels, the numbers of a frame */
  int timesteps;      /* frames of a window */
  int height, width;  /* of a picture, in pixels */
  int predicts_error; /* 1: the model has predicted errors; 0: not */
  double rate_hz;     /* of a window's frames */
  double pitch_mm[2]; /* along a row, and from row to row */
  double pixel_mm[2]; /* the size of a pixel, likewise */
  double
      filter_s; /* moving average that the training signals went through; 0: none; -1: of several lengths */
  double rest, span; /* a sample is clip((rest - value) / span, 0, 1), value in the sensor's unit */
  double delay_s; /* a picture shows where the finger was so long ago; supertac_map_add() takes that place */
} supertac_description;

/* "0.2.0" */
SUPERTAC_API const char* supertac_version(void);

/* Of this thread's last call that failed; "" before. Valid until its next call. */
SUPERTAC_API const char* supertac_error(void);

/* A model that supertac-train wrote, from a file or from memory, which may be freed afterwards. `precision`:
   SUPERTAC_FP32 or SUPERTAC_INT8. NULL on failure. */
SUPERTAC_API supertac_model* supertac_open(const char* path, int precision);
SUPERTAC_API supertac_model* supertac_open_memory(const void* bytes, size_t size, int precision);
/* Frees a model; NULL is allowed. Its supertac_live and supertac_map have to be freed before. */
SUPERTAC_API void supertac_close(supertac_model* model);

/* 0, or -1. */
SUPERTAC_API int supertac_describe(const supertac_model* model, supertac_description* description);

/* Draws `count` windows [count][timesteps][signals] in the sensor's unit, at the model's rate, oldest frame
   first. pictures: [count][height][width], 0 is the flat plate and 1 its highest point. predicted_errors: the
   same shape, how far from the truth a pixel is expected to be; NULL where it is not wanted. threads: 1 to
   1024. A picture does not depend on it, nor on the windows beside its own. 0, or -1; -1 also where
   predicted errors are wanted of a model without, or a value is NaN. */
SUPERTAC_API int supertac_draw(const supertac_model* model, size_t count, const float* windows,
                               float* pictures, float* predicted_errors, int threads);

/* Frames of a sensor to windows: moving average, resampling, scaling and normalisation, as in training.
   frame_hz: the sensor's rate, 1 to 100,000. filter_s: moving average (s) that its frames have gone through,
   0 to 10: none, or that of the model's training signals (any, where those had several). `model` must outlive
   it. NULL on failure. */
SUPERTAC_API supertac_live* supertac_live_new(const supertac_model* model, double frame_hz, double filter_s);
SUPERTAC_API void supertac_live_free(supertac_live* live);

/* One frame [signals], row by row, in the sensor's unit; time_s is the sensor's clock. 0, or -1 for a null
   pointer. A frame that is not finite, or not later than the one before, is left out; where time steps back
   by more than a gap, the window begins anew. */
SUPERTAC_API int supertac_live_push(supertac_live* live, double time_s, const float* frame);

/* The picture that ends with the newest frame, and its predicted error unless that is NULL. 1: written; 0:
   there is none yet, or a gap was just before; -1: failed. */
SUPERTAC_API int supertac_live_picture(supertac_live* live, float* picture, float* predicted_error);

/* An array of your own, as its file describes it (docs/sensors.md): order, rest, gain, dead taxels and clock
   are applied as in all programs. */
typedef struct supertac_sensor supertac_sensor; /* used by one thread at a time */
typedef struct {
  size_t size;                    /* set it to sizeof(supertac_sensor_description) before the call */
  const char *name, *unit, *port; /* of the file; valid until supertac_sensor_free() */
  int rows, columns, channels, signals;
  double pitch_mm[2], rate_hz; /* pitch along a row, and from row to row */
  double rest, span;           /* (rest - signal) / span is 0 at rest and 1 at the end of the range */
} supertac_sensor_description;
typedef struct {
  double time_s;      /* of the sensor's clock, increasing, from any zero */
  double total_force; /* sum over the taxels of (rest - signal) / span; no unit of force */
  size_t saturated;   /* signals at the end of their range, where more force changes nothing */
} supertac_frame;
enum { SUPERTAC_ENDED = 2 };

/* Reads the file `path`; "rig" is the paper's. NULL on failure. */
SUPERTAC_API supertac_sensor* supertac_sensor_new(const char* path);
SUPERTAC_API void supertac_sensor_free(supertac_sensor* sensor);
SUPERTAC_API int supertac_sensor_describe(const supertac_sensor* sensor,
                                          supertac_sensor_description* description);

/* What the sensor sends within `seconds`, 0.1 to 600, as supertac-stream --probe says it: JSON with "says", a
   list of lines, and "draft", what its file should be, or null. `port`: NULL for the file's, or another, as
   in a file. Valid until the next call. NULL on failure. */
SUPERTAC_API const char* supertac_sensor_probe(supertac_sensor* sensor, const char* port, double seconds);

/* Starts to read, by a thread of the library, which keeps the newest 4096 frames for you. 0, or -1. */
SUPERTAC_API int supertac_sensor_start(supertac_sensor* sensor, const char* port);
/* The next frame, oldest first, and its [signals] in the sensor's unit, row by row. 1: written; 0: none came
   within wait_s; SUPERTAC_ENDED: a file or pipe is at its end; -1: failed. */
SUPERTAC_API int supertac_sensor_next(supertac_sensor* sensor, double wait_s, supertac_frame* frame,
                                      float* signals);
/* Frames that did not arrive whole, and those that were not taken in time. 0, or -1. */
SUPERTAC_API int supertac_sensor_lost(supertac_sensor* sensor, unsigned long long* missing,
                                      unsigned long long* dropped);

/* One map of the whole surface that was felt, made of the model's pictures and of where they were; the same
   bits as --map of the programs. `model` must outlive it. NULL on failure. */
typedef struct supertac_map supertac_map; /* used by one thread at a time */
SUPERTAC_API supertac_map* supertac_map_new(const supertac_model* model);
SUPERTAC_API void supertac_map_free(supertac_map* map);

/* A picture [height][width] whose centre lies at (x_mm, y_mm); a place that is not finite is left out.
   predicted_error: the same shape, or NULL, and then always. 0, or -1. */
SUPERTAC_API int supertac_map_add(supertac_map* map, double x_mm, double y_mm, const float* picture,
                                  const float* predicted_error);

/* All that was felt, [height][width] cells of the model's pixel_mm, NaN where nothing was. corner_mm: x and y
   of the corner of the first cell. values, errors (half of each cell's 90 % interval; NaN where pictures had
   none): NULL where only the size is wanted. 0, or -1. */
SUPERTAC_API int supertac_map_cells(const supertac_map* map, int* height, int* width, double corner_mm[2],
                                    float* values, float* errors);

/* Windows with their truths: all that the model could be trained on of a folder of recordings of its array
   and unit; every stride-th frame of a recording ends one. NULL on failure, also where there is none. */
typedef struct supertac_pairs supertac_pairs; /* never changes */
SUPERTAC_API supertac_pairs* supertac_pairs_open(const supertac_model* model, const char* recordings,
                                                 long long stride);
SUPERTAC_API void supertac_pairs_close(supertac_pairs* pairs);
SUPERTAC_API size_t supertac_pairs_count(const supertac_pairs* pairs);
/* `count` of them from the first-th on. windows: [count][timesteps][signals] as the network takes them,
   scaled and normalised, oldest frame first (supertac_draw takes those in the sensor's unit); truths:
   [count][height][width], 0 is the flat plate and 1 its highest point, or as measured. 0, or -1. */
SUPERTAC_API int supertac_pairs_read(const supertac_pairs* pairs, size_t first, size_t count, float* windows,
                                     float* truths);

/* Trains a network on a folder of recordings and writes the model, in the place of an older file `out`, as
   supertac-train does: the same settings make the same content. recipe: "paper", "tiny" or "frame".
   settings: NULL, or what differs from the recipe. progress: NULL, or called after every step; another result
   than 0 ends the training. 1: written, 0: ended early and nothing written, -1: failed. */
typedef struct {
  size_t size;              /* set it to sizeof(supertac_training); elsewhere 0 or NULL: the recipe's */
  long long epochs, stride; /* 0: the recipe's; every stride-th frame ends a window */
  unsigned long long seed;
  const char* split; /* what is kept for testing: NULL, the recipe's "trial"; "pass", "texture", "none" ... */
} supertac_training;
typedef int (*supertac_progress)(void* user, long long step, double loss);
SUPERTAC_API int supertac_train(const char* recipe, const char* recordings, const char* out,
                                const supertac_training* settings, supertac_progress progress, void* user);

#ifdef __cplusplus
}
#endif

#endif
