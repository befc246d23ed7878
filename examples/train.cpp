// Trains the recipe `tiny` on a folder of recordings and writes the model that supertac-train writes with
// --preset tiny and the same epochs and stride: the hash that both end with is the same.
//
//   train RECORDINGS MODEL.safetensors EPOCHS STRIDE
#include <cstdio>
#include <cstdlib>
#include <exception>

#include <supertac/io/files/safetensors.h>
#include <supertac/models/training/train.h>

using namespace supertac;

int main(int argc, char** argv) try {
  if (argc != 5) {
    std::fprintf(stderr, "usage: train RECORDINGS MODEL.safetensors EPOCHS STRIDE\n");
    return 2;
  }
  Recipe recipe = Recipe::named("tiny");
  recipe.epochs = std::atoi(argv[3]);
  recipe.stride = std::atoi(argv[4]);
  train(recipe, argv[1], argv[2], {.log = [](const LogLine& line) {
          std::printf("step %ld  loss %.4f\n", static_cast<long>(line.step), line.total);
        }});
  std::printf("content %s\n", content_hash(SafetensorsFile::read(argv[2])).c_str());
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "train: %s\n", error.what());
  return 1;
}
