#include "data/recordings/imports/imports.h"

#include "io/files/file.h"
#include "io/numbers/random.h"
#include "tests/support/test.h"

namespace supertac::film_clock_test {

struct Courses {
  std::vector<double> sensor_s, sensor, film_s, film;
  FilmClock find() const { return find_film_clock({sensor_s, sensor}, {film_s, film}); }
};

// Touches of half a second and more at uneven intervals; the sensor saturates and is noisy, the film is
// slower.
class Scene {
 public:
  explicit Scene(std::uint64_t seed) : random_(seed, 0) {
    double t = 1;
    for (std::uint64_t i = 0; t < 90; ++i) {
      const double length = 0.4 + 1.5 * random_.uniform(4 * i);
      touches_.push_back(
          {t, length, 0.06 + 0.2 * random_.uniform(4 * i + 1), 0.3 + 0.7 * random_.uniform(4 * i + 2)});
      t += length + 0.3 + 2 * random_.uniform(4 * i + 3);
    }
  }
  double load(double t) const {
    double sum = 0;
    for (const Touch& touch : touches_)
      sum += touch.strength * std::clamp(std::min((t - touch.begin) / touch.ramp,
                                                  (touch.begin + touch.length - t) / touch.ramp),
                                         0.0, 1.0);
    return sum;
  }
  // sensor time = offset + rate * film time, over `seconds`.
  Courses recorded(double offset_s, double rate, double noise, double seconds, double film_hz) const {
    Courses c;
    for (std::uint64_t i = 0; i < static_cast<std::uint64_t>(100 * seconds); ++i) {
      const double t = 0.01 * static_cast<double>(i), l = load(t);
      c.sensor_s.push_back(t), c.sensor.push_back(1.6 * l / (l + 0.6) + noise * random_.normal(100'000 + i));
    }
    for (std::uint64_t i = 0; i < static_cast<std::uint64_t>(film_hz * (seconds - 2)); ++i) {
      const double t = static_cast<double>(i) / film_hz;
      c.film_s.push_back(t),
          c.film.push_back(40 * load(offset_s + rate * t) + 40 * noise * random_.normal(500'000 + i));
    }
    return c;
  }

 private:
  struct Touch {
    double begin, length, ramp, strength;
  };
  RandomStream random_;
  std::vector<Touch> touches_;
};

TEST(FilmClock, IsFoundWithin10MsAndATenthOfAPercentOrRefused) {
  int found = 0;
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    const RandomStream random(seed, 9);
    const double lag = std::lerp(0.05, 2.0, random.uniform(0)),
                 rate = std::lerp(0.98, 1.02, random.uniform(1));
    const double offset = random.uniform(2) < 0.5 ? lag : -lag;
    const Courses c = Scene(seed).recorded(offset, rate, 0.1 * random.uniform(3), 15 + 45 * random.uniform(4),
                                           std::lerp(20, 120, random.uniform(5)));
    try {
      const FilmClock clock = c.find();
      ++found;
      EXPECT_NEAR(clock.rate, rate, 0.001) << seed;
      const double middle = c.film_s.back() / 2;
      EXPECT_NEAR(clock.sensor_s(middle), offset + rate * middle, 0.01) << seed;
      EXPECT_LT(std::abs(clock.sensor_s(middle) - offset - rate * middle),
                5 * clock.offset_deviation_s + 0.003)
          << seed;
    } catch (const std::runtime_error&) {
    }
  }
  EXPECT_GE(found, 150);
}

TEST(FilmClock, RefusesWhatDoesNotAgree) {
  Courses c = Scene(1).recorded(0.6, 1, 0.02, 40, 50);
  const Courses other = Scene(2).recorded(0.6, 1, 0.02, 40, 50);
  EXPECT_NO_THROW(c.find());
  c.film = other.film;
  EXPECT_ERROR(c.find(), std::runtime_error, "sensor and film do not agree on when something touched");
  // Even intervals fit at many offsets.
  Courses even;
  for (int i = 0; i < 4000; ++i) {
    const double t = 0.01 * i;
    even.sensor_s.push_back(t), even.film_s.push_back(t);
    even.sensor.push_back(std::fmod(t, 2) < 1), even.film.push_back(std::fmod(t + 0.3, 2) < 1);
  }
  EXPECT_ERROR(even.find(), std::runtime_error, "fit alike");
}

// A film of 2x2 taxels at scale 2 that shows each touch 0.6 s late lands on the frames that felt it.
TEST(FilmTruth, LandsOnTheFramesThatFeltIt) {
  const Courses c = Scene(3).recorded(-0.6, 1.01, 0.01, 40, 30);
  Recording recording;
  recording.array = {.rows = 2, .columns = 2, .pitch_mm = 5};
  recording.signal_scale = {.unit = "counts", .rest = 0, .span = -100};
  recording.time_s = c.sensor_s;
  for (const double load : c.sensor)
    for (int k = 0; k < 4; ++k) recording.signals.push_back(static_cast<float>(25 * load));
  Table film;
  film.columns = 17, film.shape = {17};
  for (std::size_t i = 0; i < c.film.size(); ++i) {
    film.values.push_back(c.film_s[i]);
    for (int p = 0; p < 16; ++p) film.values.push_back(std::clamp(c.film[i] / 40, 0.0, 1.0));
  }
  const std::vector<double> times = take_film_times("film.csv", film, recording.array);
  EXPECT_EQ(film.shape, (std::vector<std::size_t>{4, 4}));
  const FilmClock clock = add_film(recording, "film.csv", film, times, 0, 1);
  EXPECT_NEAR(clock.offset_s, -0.6, 0.02);
  EXPECT_NEAR(clock.rate, 1.01, 0.001);
  EXPECT_EQ(recording.truth.size(), recording.frames() * 16);
  const Scene scene(3);
  double worst = 0, squares = 0;
  for (std::size_t f = 0; f < recording.frames(); ++f) {
    const double off = std::min(1.0, scene.load(recording.time_s[f])) - double{recording.truth[f * 16]};
    worst = std::max(worst, std::abs(off)), squares += off * off / static_cast<double>(recording.frames());
  }
  EXPECT_LT(std::sqrt(squares), 0.04);
  const auto again = clock_of_truth(recording, recording.time_s);
  ASSERT_TRUE(again.has_value());
  EXPECT_NEAR(again->sensor_s(20), 20, 0.01) << "nothing is left of the lag";
}

// An image for each frame, by the frames' own clock, each too late or too early by so much.
TEST(FilmTruth, OfOneClockIsPutInTimeWhereItLags) {
  for (const double lag : {0.6, -0.11, 0.004}) {
    const Courses c = Scene(5).recorded(-lag, 1, 0.02, 40, 100);
    Recording recording;
    recording.array = {.rows = 1, .columns = 1, .pitch_mm = 5};
    recording.signal_scale = {.unit = "counts", .rest = 0, .span = -100};
    recording.truth_height = recording.truth_width = 2;
    for (std::size_t i = 0; i < c.film.size(); ++i) {
      recording.time_s.push_back(c.film_s[i]);
      recording.signals.push_back(static_cast<float>(100 * c.sensor[i]));
      recording.truth.insert(recording.truth.end(), 4,
                             static_cast<float>(std::clamp(c.film[i] / 40, 0.0, 1.0)));
    }
    const std::vector<float> before = recording.truth;
    const auto clock = put_in_time(recording);
    EXPECT_EQ(clock.has_value(), std::abs(lag) > 0.02) << lag;
    if (clock) {
      EXPECT_NEAR(clock->sensor_s(20), 20 - lag, 0.01);
    } else {
      EXPECT_EQ(recording.truth, before);
    }
    const auto again = clock_of_truth(recording, recording.time_s);
    ASSERT_TRUE(again);
    EXPECT_NEAR(again->sensor_s(20), 20, 0.01) << lag;
  }
}

TEST(FilmTruth, TimesOfAnArrayStandInATableOfTheirOwn) {
  Table images, times;
  images.columns = 4, images.shape = {2, 2}, images.values.assign(12, 0);
  times.columns = 2, times.shape = {2}, times.names = {"frame", "time"}, times.values = {0, 5, 1, 5.5, 2, 6};
  EXPECT_EQ(film_times("t.csv", times, images), (std::vector<double>{5, 5.5, 6}));
  times.names.clear();
  EXPECT_EQ(what_of<FileError>([&] { film_times("t.csv", times, images); }),
            "t.csv: has 2 columns, expected one of times, or a name: time");
  times.columns = 1, times.values = {1, 2};
  EXPECT_EQ(what_of<FileError>([&] { film_times("t.csv", times, images); }),
            "t.csv: holds 2 times, expected one for each of 3 images");
  times.values = {1, 2, 2};
  EXPECT_EQ(what_of<FileError>([&] { film_times("t.csv", times, images); }),
            "t.csv: has times that do not increase, in row 2");
}

}  // namespace supertac::film_clock_test
