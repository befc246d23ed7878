#include <supertac/supertac.h>

#include <thread>

#include "data/map/surface_map.h"
#include "data/recordings/recording.h"
#include "data/windows/live_window.h"
#include "data/windows/transforms.h"
#include "io/files/file.h"
#include "io/files/safetensors.h"
#include "models/files/model_file.h"
#include "models/inference/compiled/compiled_model.h"
#include "models/training/train.h"
#include "tests/data/test_recordings.h"
#include "tests/models/support.h"
#include "tests/support/draws.h"
#include "tests/support/test.h"

namespace supertac::library_test {

class Library : public testing::Test {
 protected:
  Library() {
    SuperTacSettings settings = SuperTacSettings::of_preset("tiny");
    settings.timesteps = 32, settings.grouping = Grouping::vertical;
    Rng rng(3);
    const SuperTac network(settings, rng);
    ActivationRanges ranges;
    ranges.add(network, uniform(network.input_shape(16), 5));
    std::map<std::string, std::string> metadata =
        model_metadata(network.settings(),
                       {.rate_hz = 50, .scaling = {.per_window = true}, .filter_s = 0.05, .delay_s = 0.1});
    write_checkpoint(path_, network.parameters(), metadata, {ranges.stored()});
    file_ = load_model(path_);
  }
  // In volts.
  Tensor windows(Dim count) const {
    Tensor values = uniform(file_.model->input_shape(count), 7);
    for (real& v : values.values()) v = 2.45F - 0.4F * v;
    return values;
  }
  // Of windows in volts.
  Estimate expected(const Tensor& volts, int precision) const {
    Tensor inputs = volts.clone();
    file_.input.scaling(inputs.values());
    const auto size = static_cast<std::size_t>(file_.model->input_shape(1).elements());
    for (std::size_t at = 0; at < inputs.values().size(); at += size)
      normalise_window(inputs.values().subspan(at, size), 16);
    return drawn_of(inputs, precision);
  }
  Estimate drawn_of(const Tensor& inputs, int precision) const {
    return (precision == SUPERTAC_INT8 ? CompiledModel(*file_.model, *file_.ranges)
                                       : CompiledModel(*file_.model))
        .estimate(inputs);
  }

  TemporaryFolder folder_;
  std::string path_ = folder_ / "model.safetensors";
  ModelFile file_;
};

struct Close {
  void operator()(supertac_model* model) const { supertac_close(model); }
  void operator()(supertac_live* live) const { supertac_live_free(live); }
};
using Model = std::unique_ptr<supertac_model, Close>;
using Live = std::unique_ptr<supertac_live, Close>;

TEST_F(Library, DescribesTheModel) {
  const Model model(supertac_open(path_.c_str(), SUPERTAC_FP32));
  ASSERT_NE(model, nullptr) << supertac_error();
  supertac_description about{};
  EXPECT_EQ(supertac_describe(model.get(), &about), -1);  // without its size
  about.size = sizeof about;
  ASSERT_EQ(supertac_describe(model.get(), &about), 0);
  EXPECT_EQ(about.signals, 16);
  EXPECT_EQ(about.timesteps, 32);
  EXPECT_EQ(about.height, 16);
  EXPECT_EQ(about.predicts_error, 1);
  EXPECT_EQ(about.pixel_mm[0], 0.75);
  EXPECT_EQ(about.pixel_mm[1], 0.75);
  EXPECT_EQ(about.filter_s, 0.05);
  EXPECT_EQ(about.delay_s, 0.1);
  supertac_description older{};
  older.size = offsetof(supertac_description, rate_hz);
  ASSERT_EQ(supertac_describe(model.get(), &older), 0);
  EXPECT_EQ(older.predicts_error, 1);
  EXPECT_EQ(older.rate_hz, 0);  // not written
}

TEST_F(Library, DrawsTheBitsOfTheProgramsFromFilesAndMemoryWithAnyThreads) {
  const std::vector<std::byte> bytes = read_file(path_, 1 << 26);
  const Tensor inputs = windows(37);
  for (const int precision : {SUPERTAC_FP32, SUPERTAC_INT8}) {
    const Model models[] = {Model(supertac_open(path_.c_str(), precision)),
                            Model(supertac_open_memory(bytes.data(), bytes.size(), precision))};
    const Estimate all = expected(inputs, precision);
    for (const Model& model : models)
      for (const int threads : {1, 4}) {
        ASSERT_NE(model, nullptr) << supertac_error();
        std::vector<float> pictures(37 * 256), errors(37 * 256);
        ASSERT_EQ(supertac_draw(model.get(), 37, inputs.data(), pictures.data(), errors.data(), threads), 0);
        EXPECT_TRUE(std::ranges::equal(pictures, all.picture.values()));
        EXPECT_TRUE(std::ranges::equal(errors, all.predicted_error.values()));
      }
  }
}

TEST_F(Library, DrawsFramesAsLiveWindowsDo) {
  const Model model(supertac_open(path_.c_str(), SUPERTAC_INT8));
  const Live live(supertac_live_new(model.get(), 100, 0));
  ASSERT_NE(live, nullptr) << supertac_error();
  LiveWindow window({.timesteps = 32,
                     .rate_hz = 50,
                     .scaling = file_.input.scaling,
                     .filter_s = 0.05,
                     .frame_period_s = 0.01});
  const Tensor noise = uniform(Shape{150, 16}, 9);
  Tensor input(file_.model->input_shape(1));
  std::vector<float> picture(256);
  int drawn = 0;
  for (int i = 0; i < 150; ++i) {
    std::vector<float> frame(noise.data() + 16 * i, noise.data() + 16 * i + 16);
    for (float& v : frame) v = 2.45F - 0.3F * v;
    const double time_s = 0.01 * i + (i > 100 ? 0.3 : 0);
    window.push(time_s, frame);
    ASSERT_EQ(supertac_live_push(live.get(), time_s, frame.data()), 0);
    const bool due = window.window(input.values());
    ASSERT_EQ(supertac_live_picture(live.get(), picture.data(), nullptr), due ? 1 : 0);
    if (!due) continue;
    ++drawn;
    ASSERT_TRUE(std::ranges::equal(picture, drawn_of(input, SUPERTAC_INT8).picture.values()));
  }
  EXPECT_GT(drawn, 30);
}

TEST_F(Library, MapsAsTheCppLibraryDoes) {
  supertac_model* model = supertac_open(path_.c_str(), SUPERTAC_FP32);
  supertac_map* map = supertac_map_new(model);
  ASSERT_NE(map, nullptr);
  SurfaceMap expected(file_.array().picture(4));
  Draws draw(3, 5);
  std::vector<float> picture(256), errors(256);
  for (int k = 0; k < 40; ++k) {
    for (std::vector<float>* drawn : {&picture, &errors})
      for (float& v : *drawn) v = static_cast<float>(draw());
    const double y = 0.3 * k;
    expected.add(-4, y, picture, errors);
    ASSERT_EQ(supertac_map_add(map, -4, y, picture.data(), errors.data()), 0);
  }
  int height = 0, width = 0;
  double corner[2];
  ASSERT_EQ(supertac_map_cells(map, &height, &width, corner, nullptr, nullptr), 0);
  const MapCells cells = expected.cells(expected.felt());
  EXPECT_EQ(height, cells.region.height);
  EXPECT_EQ(width, cells.region.width);
  EXPECT_DOUBLE_EQ(corner[0], 0.75 * static_cast<double>(cells.region.left));
  std::vector<float> values(cells.values.size()), widths(values.size());
  ASSERT_EQ(supertac_map_cells(map, &height, &width, corner, values.data(), widths.data()), 0);
  for (std::size_t i = 0; i < values.size(); ++i)
    ASSERT_EQ(std::bit_cast<std::uint32_t>(values[i]), std::bit_cast<std::uint32_t>(cells.values[i])) << i;
  std::vector<float> half_widths = cells.errors;
  file_.interval().half_widths(cells.values, width, half_widths, half_widths);
  EXPECT_EQ(widths, half_widths);
  EXPECT_EQ(supertac_map_add(map, 0, 0, nullptr, nullptr), -1);
  EXPECT_STREQ(supertac_error(), "supertac_map_add: a pointer is NULL");
  supertac_map_free(map);
  supertac_close(model);
}

TEST_F(Library, GivesTheWindowsAndTruthsOfTheCppLibrary) {
  const std::string data = folder_ / "data";
  make_directories(data);
  write_recording(data + "/a.safetensors", make_recording({.frames = 400, .level = 2.2F}));
  const Model model(supertac_open(path_.c_str(), SUPERTAC_FP32));
  supertac_pairs* const pairs = supertac_pairs_open(model.get(), data.c_str(), 3);
  ASSERT_NE(pairs, nullptr) << supertac_error();
  WindowSettings settings = file_.windows();
  settings.stride = 3;
  const WindowSet expected = WindowSet::load(data, {}, settings);
  const std::size_t count = supertac_pairs_count(pairs), pixels = expected.image().pixels();
  ASSERT_EQ(count, expected.size());
  ASSERT_GT(count, 5U);
  std::vector<float> windows((count - 2) * expected.input_size()), truths((count - 2) * pixels);
  ASSERT_EQ(supertac_pairs_read(pairs, 2, count - 2, windows.data(), truths.data()), 0);
  std::vector<float> window(expected.input_size()), truth(pixels);
  for (std::size_t i = 2; i < count; ++i) {
    expected.window(i, window), expected.truth(i, truth);
    EXPECT_TRUE(
        std::ranges::equal(window, std::span(windows).subspan((i - 2) * window.size(), window.size())));
    EXPECT_TRUE(std::ranges::equal(truth, std::span(truths).subspan((i - 2) * pixels, pixels)));
  }
  EXPECT_EQ(supertac_pairs_read(pairs, 3, count - 2, windows.data(), truths.data()), -1);
  supertac_pairs_close(pairs);
  EXPECT_EQ(supertac_pairs_open(model.get(), data.c_str(), 0), nullptr);
  EXPECT_EQ(supertac_pairs_open(model.get(), (folder_ / "none").c_str(), 1), nullptr);
  EXPECT_NE(std::string(supertac_error()).find("none"), std::string::npos);
}

TEST_F(Library, ReadsASensorToItsEnd) {
  const std::string sensor_file = folder_ / "mat.json", lines = folder_ / "lines.csv";
  write_file(sensor_file, R"({"name": "mat", "rows": 1, "columns": 3, "pitch_mm": 5, "unit": "counts",
"pressed": "higher", "range": [0, 100], "rate_hz": 100, "port": "missing.csv", "order": [2, 1, 0], "dead": [1],
"frame": {"kind": "text", "separator": ",", "time": {"column": 0, "unit": "ms"}}})");
  write_file(lines, "0,1,2,3\n10,4,5,100\n20,x,8,9\n30,nan,8,9\n40,10,11,12\n");
  supertac_sensor* const sensor = supertac_sensor_new(sensor_file.c_str());
  ASSERT_NE(sensor, nullptr) << supertac_error();
  supertac_sensor_description about{};
  about.size = sizeof about;
  ASSERT_EQ(supertac_sensor_describe(sensor, &about), 0);
  EXPECT_STREQ(about.name, "mat");
  EXPECT_STREQ(about.unit, "counts");
  EXPECT_STREQ(about.port, "missing.csv");
  EXPECT_EQ(about.signals, 3);
  EXPECT_EQ(about.rest - about.span, 100);
  supertac_frame frame{};
  float signals[3];
  EXPECT_EQ(supertac_sensor_next(sensor, 1, &frame, signals), -1);  // not started
  EXPECT_EQ(supertac_sensor_start(sensor, nullptr), -1);
  EXPECT_NE(std::string(supertac_error()).find("missing.csv"), std::string::npos);
  ASSERT_EQ(supertac_sensor_start(sensor, lines.c_str()), 0) << supertac_error();
  std::vector<std::vector<float>> seen;
  std::vector<double> times;
  int result = 0;
  while ((result = supertac_sensor_next(sensor, 5, &frame, signals)) == 1) {
    seen.emplace_back(signals, signals + 3), times.push_back(frame.time_s);
    EXPECT_NEAR(frame.total_force, (signals[0] + signals[1] + signals[2]) / 100, 1e-6);
    EXPECT_EQ(frame.saturated, signals[0] == 100 ? 1U : 0U);
  }
  EXPECT_EQ(result, SUPERTAC_ENDED) << supertac_error();
  EXPECT_EQ(seen, (std::vector<std::vector<float>>{{3, 2, 1}, {100, 52, 4}, {12, 11, 10}}));
  ASSERT_EQ(times.size(), 3U);
  EXPECT_NEAR(times[1] - times[0], 0.01, 1e-6);
  EXPECT_NEAR(times[2] - times[0], 0.04, 1e-6);
  unsigned long long missing = 0, dropped = 1;
  ASSERT_EQ(supertac_sensor_lost(sensor, &missing, &dropped), 0);
  EXPECT_EQ(missing, 1U);  // five stamps do not tell yet that one line was no frame
  EXPECT_EQ(dropped, 0U);
  EXPECT_EQ(supertac_sensor_start(sensor, lines.c_str()), -1);  // it is being read
  supertac_sensor_free(sensor);
  supertac_sensor_free(nullptr);
  EXPECT_EQ(supertac_sensor_new((folder_ / "none.json").c_str()), nullptr);
}

TEST_F(Library, TrainsWhatTheCppLibraryTrains) {
  make_directories(folder_ / "data");
  write_recording(folder_ / "data/a.safetensors", make_recording({.frames = 3000}));
  Recipe recipe = Recipe::named("tiny");
  recipe.epochs = 2, recipe.stride = 4, recipe.seed = 5, recipe.split = SplitKind::none;
  for (const auto& [out, why] :
       {std::pair{folder_ / "data", ": is no name of a file to write a model to"},
        {folder_ / "none/m.safetensors", ": cannot be written: its folder is missing"}})
    EXPECT_EQ(what_of<FileError>([&, &out = out] { train(recipe, folder_ / "data", out); }), out + why);
  train(recipe, folder_ / "data", folder_ / "cpp.safetensors");
  const supertac_training settings{
      .size = sizeof(supertac_training), .epochs = 2, .stride = 4, .seed = 5, .split = "none"};
  const std::string data = folder_ / "data", out = folder_ / "c.safetensors";
  const auto train_c = [&](const char* recipe_name, supertac_progress progress, void* user) {
    return supertac_train(recipe_name, data.c_str(), out.c_str(), &settings, progress, user);
  };
  long long steps = 0;
  const supertac_progress end_at_once = [](void* user, long long step, double loss) {
    *static_cast<long long*>(user) = step;
    return loss > 0 ? 1 : 0;
  };
  ASSERT_EQ(train_c("tiny", end_at_once, &steps), 0) << supertac_error();
  EXPECT_EQ(steps, 1);
  EXPECT_THROW(read_file(out, 1 << 26), FileError);
  ASSERT_EQ(train_c("tiny", nullptr, nullptr), 1) << supertac_error();
  EXPECT_EQ(content_hash(SafetensorsFile::read(out)),
            content_hash(SafetensorsFile::read(folder_ / "cpp.safetensors")));
  for (const std::string& name : {std::string(folder_ / "data"), folder_ / "none/m.safetensors"}) {
    steps = 0;
    EXPECT_EQ(supertac_train("tiny", data.c_str(), name.c_str(), &settings, end_at_once, &steps), -1);
    EXPECT_EQ(steps, 0) << "found behind the training: " << supertac_error();
  }
  EXPECT_EQ(train_c("huge", nullptr, nullptr), -1);
  EXPECT_NE(std::string(supertac_error()).find("huge"), std::string::npos);
  EXPECT_EQ(supertac_train("tiny", nullptr, "x", nullptr, nullptr, nullptr), -1);
  const supertac_training no_size{};
  EXPECT_EQ(supertac_train("tiny", data.c_str(), "x", &no_size, nullptr, nullptr), -1);
}

TEST_F(Library, SaysWhatWasWrongToTheThreadThatAsked) {
  EXPECT_EQ(supertac_open("/no/such/model", SUPERTAC_FP32), nullptr);
  EXPECT_NE(std::string(supertac_error()).find("/no/such/model"), std::string::npos) << supertac_error();
  std::thread([] { EXPECT_STREQ(supertac_error(), ""); }).join();
  EXPECT_EQ(supertac_open(path_.c_str(), 7), nullptr);
  EXPECT_EQ(supertac_open(nullptr, 0), nullptr);
  EXPECT_EQ(supertac_open_memory("{}", 2, 0), nullptr);
  EXPECT_EQ(std::string(supertac_error()).rfind("model in memory", 0), 0U) << supertac_error();
  const Model model(supertac_open(path_.c_str(), SUPERTAC_FP32));
  float one = 0;
  EXPECT_EQ(supertac_draw(model.get(), 1, nullptr, &one, nullptr, 1), -1);
  EXPECT_EQ(supertac_draw(nullptr, 1, &one, &one, nullptr, 1), -1);
  EXPECT_EQ(supertac_draw(model.get(), 1, &one, &one, nullptr, 0), -1);
  EXPECT_EQ(supertac_draw(model.get(), ~std::size_t{0}, &one, &one, nullptr, 1), -1);
  EXPECT_EQ(supertac_draw(model.get(), 0, nullptr, nullptr, nullptr, 1), 0);
  const std::unique_ptr<SuperTac> network = load_model(path_).model;
  std::vector<float> window(static_cast<std::size_t>(network->input_shape(1).elements()), 2.3F),
      picture(static_cast<std::size_t>(network->picture_shape(1).elements()));
  ASSERT_EQ(supertac_draw(model.get(), 1, window.data(), picture.data(), nullptr, 1), 0) << supertac_error();
  window[5] = NAN;
  EXPECT_EQ(supertac_draw(model.get(), 1, window.data(), picture.data(), nullptr, 1), -1);
  EXPECT_NE(std::string(supertac_error()).find("NaN"), std::string::npos) << supertac_error();
  EXPECT_EQ(supertac_live_new(model.get(), 0, 0), nullptr);
  EXPECT_EQ(supertac_live_new(model.get(), 100, 0.5), nullptr);
  EXPECT_NE(std::string(supertac_error()).find("moving average"), std::string::npos);
  EXPECT_EQ(supertac_live_push(nullptr, 0, &one), -1);
  EXPECT_EQ(supertac_live_picture(nullptr, &one, nullptr), -1);
  supertac_close(nullptr), supertac_live_free(nullptr);
}

// Flipped, cut and doubled bytes, checksum mended by leaving it out: an error or a model that draws. The full
// run is SUPERTAC_FUZZ_RUNS=10000.
TEST_F(Library, TakesAnyBytesAndAnyCalls) {
  const std::uint64_t runs = number_of("SUPERTAC_FUZZ_RUNS", 300);
  std::vector<std::byte> bytes = read_file(path_, 1 << 26);
  // A file without our two fields is another program's: only so do changes get behind the checksum.
  std::string text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  for (const char* const field : {"\"supertac_format\":\"1\"", "\"checksum\":\""}) {
    const std::size_t at = text.find(field);
    ASSERT_NE(at, std::string::npos) << field;
    text[at + 1] = 'X';
  }
  const std::size_t header = text.find("}}") + 64;
  Draws draw(17, 1);
  std::uint64_t opened = 0;
  for (std::uint64_t run = 0; run < runs; ++run) {
    std::string changed = text;
    for (std::size_t flips = 1 + draw.below(4); flips > 0; --flips)
      changed[draw.below(draw.below(2) == 0 ? std::min(header, changed.size()) : changed.size())] =
          static_cast<char>(draw.below(256));
    if (draw.below(8) == 0) changed.resize(draw.below(changed.size()));
    const int precision = static_cast<int>(draw.below(2));
    const Model model(supertac_open_memory(changed.data(), changed.size(), precision));
    if (model == nullptr) {
      EXPECT_STRNE(supertac_error(), "");
      continue;
    }
    ++opened;
    supertac_description about{};
    about.size = sizeof about;
    ASSERT_EQ(supertac_describe(model.get(), &about), 0);
    std::vector<float> window(static_cast<std::size_t>(about.timesteps * about.signals), 0.3F),
        picture(static_cast<std::size_t>(about.height * about.width));
    supertac_draw(model.get(), 1, window.data(), picture.data(), nullptr,
                  1 + static_cast<int>(draw.below(2)));
    const Live live(supertac_live_new(model.get(), 1 + 1000 * draw(), draw.below(2) == 0 ? 0 : 0.1));
    for (int i = 0; live != nullptr && i < 20; ++i) {
      window[draw.below(window.size())] = draw.below(5) == 0 ? NAN : 2.0F;
      supertac_live_push(live.get(), draw() * 3, window.data());
      supertac_live_picture(live.get(), picture.data(), nullptr);
    }
  }
  EXPECT_GT(opened, runs / 20);
}

}  // namespace supertac::library_test
