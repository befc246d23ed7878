// lessons N | all | break FAILURE PICTURE.svg. See ../README.md.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>

#include "docs/lessons/check/check.h"
#include "io/files/file.h"

namespace {

using namespace lessons;

/// The small network with the ops of these lessons, against the same with the project's.
bool compose(int first, int last) {
  Ops yours;
  for (int lesson = first; lesson <= last; ++lesson) yours.yours[lesson] = true;
  const Losses with_yours = train_whole(yours), with_ours = train_whole({});
  std::printf("  the whole: loss %.6f before, %.6f after 60 steps; with the project's ops %.6f\n",
              with_yours.first, with_yours.last, with_ours.last);
  return std::abs(with_yours.last - with_ours.last) < 1e-6 && with_yours.last < with_yours.first;
}

bool lesson(int first, int last) {
  for (int n = first; n <= last; ++n) {
    std::printf("lesson %d\n", n);
    try {
      check(n);
    } catch (const Wrong& wrong) {
      std::printf("  wrong: %s\n", wrong.text.c_str());
      return false;
    }
  }
  const bool composes = last > 1 && first < 8;  // the ops of lessons 2 to 7
  const bool good = !composes || compose(first, last);
  std::puts(
      good ? "  passed"
           : "  wrong: the entries agree and the whole does not; is something added that should be set?");
  return good;
}

int run(int argc, char** argv) {
  const std::string word = argc > 1 ? argv[1] : "";
  const int number = std::atoi(word.c_str());
  if (word == "break" && argc == 4) {
    supertac::write_file(argv[3], break_it(std::atoi(argv[2])));
    return 0;
  }
  if (argc == 2 && (word == "all" || (number >= 1 && number <= 8))) {
    return (word == "all" ? lesson(1, 8) : lesson(number, number)) ? 0 : 1;
  }
  std::fputs("usage: lessons 1 to 8 | lessons all | lessons break 1 to 13 PICTURE.svg\n", stderr);
  return 2;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "lessons: %s\n", error.what());
    return 1;
  }
}
