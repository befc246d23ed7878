/* Pictures of windows at rest, and the most memory that was held (Linux's VmHWM): what cold_start.py and
   instructions.py start again and again.

     first_picture MODEL fp32|int8 [CALLS [BATCH]]      both are 1 unless given */
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

static int draw(const supertac_model* model, int calls, size_t batch) {
  supertac_description about;
  float *windows, *pictures;
  int failed = 0;
  about.size = sizeof about;
  if (model == NULL || supertac_describe(model, &about) != 0) return -1;
  windows = calloc(batch * (size_t)(about.timesteps * about.signals), sizeof *windows);
  pictures = calloc(batch * (size_t)(about.height * about.width), sizeof *pictures);
  while (windows != NULL && pictures != NULL && failed == 0 && calls-- > 0)
    failed = supertac_draw(model, batch, windows, pictures, NULL, 1);
  free(windows), free(pictures);
  return failed;
}

int main(int argc, char** argv) {
  supertac_model* model;
  if (argc < 3) return 2;
  model = supertac_open(argv[1], strcmp(argv[2], "int8") == 0 ? SUPERTAC_INT8 : SUPERTAC_FP32);
  if (draw(model, argc > 3 ? atoi(argv[3]) : 1, argc > 4 ? (size_t)atoi(argv[4]) : 1) == 0)
    return tell_memory();
  fprintf(stderr, "first_picture: %s\n", supertac_error());
  return 1;
}
