#include "models/files/exports.h"

#include <dlfcn.h>

#include "data/windows/live_window.h"
#include "io/files/file.h"
#include "models/inference/compiled/compiled_model.h"
#include "tests/models/support.h"
#include "tests/support/test.h"

namespace supertac::c_code_test {

// What was written, compiled by the C compiler of this machine as somebody might who wants it fast.
class Compiled {
 public:
  /// `words`: compiler and flags. `more`: files beside those of `code`, and all that is compiled.
  Compiled(const CCode& code, const std::string& words, const std::map<std::string, std::string>& more = {}) {
    write_file(folder_ / "finger.h", code.header);
    write_file(folder_ / "finger.c", code.source);
    for (const auto& [name, text] : more) write_file(folder_ / name, text);
    const std::string library = folder_ / "finger.so", said = folder_ / "said.txt";
    const std::string command = words + " -std=gnu99 -Wall -Wextra -Werror -shared -fPIC -o " + library +
                                " " + (folder_ / (more.empty() ? "finger.c" : "unit.c")) + " 2> " + said;
    if (std::system(command.c_str()) == 0) library_ = dlopen(library.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (library_ == nullptr) {
      std::string text = read_text_file(said, 1 << 20);
      std::ranges::replace(text, '\n', ' ');
      throw std::runtime_error(text);
    }
  }
  ~Compiled() {
    if (library_ != nullptr) dlclose(library_);
  }
  Compiled(const Compiled&) = delete;
  Compiled& operator=(const Compiled&) = delete;
  template <class Function>
  Function* function(const char* name) const {
    return reinterpret_cast<Function*>(dlsym(library_, name));
  }
  /// Of the model of that name, which draws for it.
  std::uint64_t self_test(const std::string& name = "finger") const {
    std::vector<float> picture(4096), predicted_error(4096);
    return function<std::uint64_t(float*, float*)>((name + "_self_test").c_str())(picture.data(),
                                                                                  predicted_error.data());
  }

 private:
  TemporaryFolder folder_;
  void* library_ = nullptr;
};

// The compiler with which a command begins.
bool has_compiler(const std::string& words = "cc") {
  return std::system((words.substr(0, words.find(' ')) + " --version > /dev/null 2>&1").c_str()) == 0;
}

// What the header says that self_test() returns.
std::uint64_t self_test_of(const CCode& code) {
  return std::stoull(code.header.substr(code.header.find("SELF_TEST 0x") + 10), nullptr, 16);
}

SuperTacSettings tiny() { return SuperTacSettings::of_preset("tiny"); }

std::vector<SuperTacSettings> all_settings() {
  std::vector<SuperTacSettings> all{tiny(), tiny(), tiny(), SuperTacSettings::of_preset("paper")};
  all[1].rows = 3, all[1].columns = 5, all[1].in_channels = 3, all[1].scale = 8;
  all[1].grouping = Grouping::vertical, all[1].timesteps = 48;
  all[2].channels = 12, all[2].rcabs = 0, all[2].predicted_error = false, all[2].latent = 3,
  all[2].timesteps = 32;
  all.push_back(tiny());
  all.back().last_frame_path = true, all.back().timesteps = 32;
  all.push_back(all.back());
  all.back().timesteps = 1;
  return all;
}

TEST(CCode, DrawsTheBitsOfACompiledModel) {
  if (!has_compiler()) GTEST_SKIP() << "no C compiler";
  for (const SuperTacSettings& settings : all_settings())
    for (const char* flags :
         {"cc -Og", "cc -O1", "cc -O2", "cc -Os", "cc -O3 -march=native",
          "cc -O2 -march=native -ffp-contract=fast", "clang -O2", "clang -O3 -march=native",
          "cc -O1 -fsanitize=undefined -fno-sanitize-recover"}) {
      if (!has_compiler(flags)) continue;
      const ModelFile file = model_of(settings, {});
      const CCode exported = c_code_of(file, "finger", 100);
      const Compiled code(exported, flags);
      const auto draw = code.function<void(const float*, float*, float*)>("finger_draw");
      const Tensor windows = uniform(file.model->input_shape(5), 7);
      const Estimate expected = CompiledModel(*file.model, *file.ranges).estimate(windows);
      const auto pixels = static_cast<std::size_t>(expected.picture.size() / 5);
      std::vector<float> picture(pixels), predicted_error(pixels);
      EXPECT_EQ(code.self_test(), self_test_of(exported)) << flags;
      for (std::size_t n = 0; n < 5; ++n) {
        draw(windows.data() + n * static_cast<std::size_t>(windows.size() / 5), picture.data(),
             predicted_error.data());
        EXPECT_TRUE(std::ranges::equal(picture, expected.picture.values().subspan(n * pixels, pixels)))
            << flags;
        if (settings.predicted_error) {
          EXPECT_TRUE(std::ranges::equal(predicted_error,
                                         expected.predicted_error.values().subspan(n * pixels, pixels)));
        }
      }
    }
}

// Frames that jitter, are lost, come twice, are no numbers, and a silence in which all begins anew.
TEST(CCode, DrawsWhatLiveWindowsDraw) {
  if (!has_compiler()) GTEST_SKIP() << "no C compiler";
  for (const Dim timesteps : {32, 1})
    for (const auto& [filter_s, sensor_hz, per_window] :
         {std::tuple(0.0, 120.0, false), {0.05, 120.0, timesteps > 1}, {0.0, 15.0, false}}) {
      SuperTacSettings settings = tiny();
      settings.timesteps = timesteps;
      settings.last_frame_path = timesteps == 1;
      const ModelFile file =
          model_of(settings, {.rate_hz = 50, .scaling = {.per_window = per_window}, .filter_s = filter_s});
      const CCode exported = c_code_of(file, "finger", sensor_hz);
      const Compiled code(exported, "cc -O3 -march=native");
      const auto push = code.function<int(double, const float*)>("finger_push_at");
      const auto draw = code.function<int(float*, float*)>("finger_picture");
      LiveWindow live({.timesteps = static_cast<int>(timesteps),
                       .signals = 16,
                       .rate_hz = 50,
                       .scaling = file.input.scaling,
                       .filter_s = filter_s,
                       .frame_period_s = 1 / sensor_hz});
      const CompiledModel compiled(*file.model, *file.ranges);
      Tensor window(file.model->input_shape(1));
      const Tensor noise = uniform(Shape{400, 17}, 11);
      std::vector<float> picture(256), predicted_error(256), frame(16);
      int pictures = 0;
      double time_s = 3;
      for (int i = 0; i < 400; ++i) {
        const real* random = noise.data() + 17 * i;
        time_s += (1 + 0.3 * (static_cast<double>(random[16]) - 0.5)) / sensor_hz;
        if (i == 230) time_s += 24 / sensor_hz;
        if (i % 37 == 5) continue;
        for (std::size_t k = 0; k < 16; ++k)
          frame[k] = 2.45F - 0.3F * static_cast<float>(random[k]) * static_cast<float>(i % 90) / 90;
        if (i == 150) frame[3] = NAN;
        live.push(time_s, frame);
        push(time_s, frame.data());
        if (i % 41 == 0) live.push(time_s, frame), push(time_s, frame.data());
        const bool due = live.window(window.values());
        ASSERT_EQ(draw(picture.data(), predicted_error.data()) == 1, due) << "frame " << i;
        if (!due) continue;
        ++pictures;
        const Estimate expected = compiled.estimate(window);
        ASSERT_TRUE(std::ranges::equal(picture, expected.picture.values())) << "frame " << i;
      }
      EXPECT_GT(pictures, 150);
      EXPECT_EQ(code.self_test(), self_test_of(exported));
    }
}

// A compiler that rearranges sums gives other bits: it is refused by name, and one that does not say so when
// it runs.
TEST(CCode, RefusesACompilerThatRearrangesSums) {
  if (!has_compiler()) GTEST_SKIP() << "no C compiler";
  const CCode exported = c_code_of(model_of(tiny(), {}), "finger", 100);
  for (const std::string words :
       {"cc -O2 -ffast-math", "cc -Ofast", "cc -O2 -ffinite-math-only", "clang -O1 -ffast-math"}) {
    if (!has_compiler(words)) continue;
    EXPECT_ERROR(Compiled(exported, words), std::runtime_error, "takes frames that are no numbers");
  }
  CCode quiet = exported;
  const std::size_t error = quiet.source.find("#error");
  quiet.source.erase(error, quiet.source.find('\n', error) - error);
  const Compiled code(quiet, "cc -O2 -ffast-math");
  const std::vector<float> frame(16, 2.4F);
  EXPECT_EQ(code.self_test(), 0U);
  for (int i = 0; i < 1000; ++i) ASSERT_EQ(code.function<int(const float*)>("finger_push")(frame.data()), 0);
}

TEST(CCode, SeveralModelsFitIntoOneUnit) {
  if (!has_compiler()) GTEST_SKIP() << "no C compiler";
  SuperTacSettings other = tiny();
  other.rows = 3, other.scale = 2, other.timesteps = 32;
  const CCode finger = c_code_of(model_of(tiny(), {}), "finger", 100),
              palm = c_code_of(model_of(other, {.scaling = {}, .filter_s = 0.02}), "palm", 300);
  const std::map<std::string, std::string> more = {
      {"palm.h", palm.header},
      {"palm.c", palm.source},
      {"unit.c", "#include \"finger.c\"\n#include \"palm.c\"\n"}};
  for (const std::string words : {"cc -O2", "clang -O2"}) {
    if (!has_compiler(words)) continue;
    const Compiled unit(finger, words, more);
    for (int turn = 0; turn < 2; ++turn) {
      EXPECT_EQ(unit.self_test(), self_test_of(finger));
      EXPECT_EQ(unit.self_test("palm"), self_test_of(palm));
    }
  }
}

TEST(CCode, RefusesWhatIsNoNameOrRateOrHasNoRanges) {
  ModelFile file = model_of(tiny(), {});
  EXPECT_REFUSAL("C code: name expects an identifier of C, such as finger, got '1st'",
                 c_code_of(file, "1st", 100));
  EXPECT_REFUSAL("C code: name expects an identifier of C, such as finger, got 'a b'",
                 c_code_of(file, "a b", 100));
  EXPECT_REFUSAL("C code: sensor_hz expects 1 to 100000, got 0", c_code_of(file, "finger", 0));
  file.ranges.reset();
  EXPECT_EQ(what_of<std::runtime_error>([&] { c_code_of(file, "finger", 100); }),
            "the model was saved without the ranges of its values, which int8 needs; train it anew with this "
            "version, or take precision fp32");
}

TEST(CCode, RefusesLayersThatItsSixteenBitsCannotCount) {
  SuperTacSettings wide = tiny();
  wide.rows = wide.columns = 16, wide.channels = 128, wide.latent = 1, wide.rcabs = 0, wide.scale = 2;
  wide.timesteps = 32;
  EXPECT_ERROR(c_code_of(model_of(wide, {}), "finger", 100), std::runtime_error,
               "int8: a layer has a size or a distance of 32768, expected at most 32767; train a network of "
               "fewer channels");
}

}  // namespace supertac::c_code_test
