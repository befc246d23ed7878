/* Pictures of a stream of frames, in C: frames as text on standard input,
   a line each, the time in seconds first.

     draw_live MODEL FRAMES_PER_SECOND < frames.txt

   Every picture is a line of its own, its pixels row by row. */
#include <stdio.h>
#include <stdlib.h>
#include <supertac/supertac.h>

static int fail(const char *what) {
  fprintf(stderr, "draw_live: %s\n", what);
  return 1;
}

int main(int argc, char **argv) {
  supertac_description about;
  supertac_model *model;
  supertac_live *live;
  float *frame, *picture;
  double time_s;
  int i, drawn;
  about.size = sizeof about;
  if (argc != 3) return fail("expects MODEL FRAMES_PER_SECOND");
  model = supertac_open(argv[1], SUPERTAC_INT8);
  if (model == NULL || supertac_describe(model, &about) != 0) return fail(supertac_error());
  live = supertac_live_new(model, atof(argv[2]), 0);
  if (live == NULL) return fail(supertac_error());
  frame = malloc(sizeof *frame * (size_t)about.signals);
  picture = malloc(sizeof *picture * (size_t)(about.height * about.width));
  if (frame == NULL || picture == NULL) return fail("not enough memory");
  while (scanf("%lf", &time_s) == 1) {
    for (i = 0; i < about.signals; ++i)
      if (scanf("%f", frame + i) != 1) return fail("a frame is too short");
    drawn = supertac_live_push(live, time_s, frame) == 0 ? supertac_live_picture(live, picture, NULL) : -1;
    if (drawn < 0) return fail(supertac_error());
    for (i = 0; drawn == 1 && i < about.height * about.width; ++i)
      printf("%s%.9g", i == 0 ? "" : " ", (double)picture[i]);
    if (drawn == 1) printf("\n");
  }
  supertac_live_free(live);
  supertac_close(model);
  free(frame), free(picture);
  return 0;
}
