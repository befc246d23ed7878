/* A picture of a window at rest, and the most memory that was held (Linux's VmHWM): what cold_start.py starts
   again and again.

     first_picture MODEL */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <supertac/supertac.h>

static int tell_memory(void) {
  char line[256];
  FILE* status = fopen("/proc/self/status", "r");
  while (status != NULL && fgets(line, sizeof line, status) != NULL)
    if (strncmp(line, "VmHWM:", 6) == 0) fputs(line, stdout);
  return status != NULL && fclose(status) == 0 ? 0 : 1;
}

static int draw(const supertac_model* model) {
  supertac_description about;
  float *window, *picture;
  int failed = -1;
  about.size = sizeof about;
  if (model == NULL || supertac_describe(model, &about) != 0) return -1;
  window = calloc((size_t)(about.timesteps * about.signals), sizeof *window);
  picture = calloc((size_t)(about.height * about.width), sizeof *picture);
  if (window != NULL && picture != NULL) failed = supertac_draw(model, 1, window, picture, NULL, 1);
  free(window), free(picture);
  return failed;
}

int main(int argc, char** argv) {
  supertac_model* model;
  if (argc != 2) return 2;
  model = supertac_open(argv[1], SUPERTAC_FP32);
  if (draw(model) == 0) return tell_memory();
  fprintf(stderr, "first_picture: %s\n", supertac_error());
  return 1;
}
