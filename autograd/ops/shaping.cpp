#include "autograd/ops/shaping.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "autograd/record.h"
#include "autograd/trace.h"

namespace supertac {
namespace {

void check_has_columns(const char* op, const char* argument, const Variable& x) {
  check_defined(op, argument, x);
  if (x.rank() < 1) refuse(op, argument, "rank 1 or more", "[]");
}

void check_no_gradient(const char* op, const char* argument, const Variable& x) {
  if (x.requires_grad()) refuse(op, argument, "a constant", "a variable that requires a gradient");
}

Shape with_last(const Shape& shape, Dim last) {
  std::array<Dim, kMaxRank> dims{};
  for (int i = 0; i < shape.rank(); ++i) dims[static_cast<std::size_t>(i)] = shape[i];
  dims[static_cast<std::size_t>(shape.rank() - 1)] = last;
  return Shape(std::span<const Dim>(dims.data(), static_cast<std::size_t>(shape.rank())));
}

// Columns at .. at + length of an array of rows of this width.
struct Columns {
  Dim width, at;
};
// to[r, t.at + i] = or += from[r, f.at + i] for each row r and i < length
void move_columns(Dim rows, Dim length, const real* from, Columns f, Into into, real* to, Columns t) {
  for (Dim r = 0; r < rows; ++r) {
    const real* source = from + r * f.width + f.at;
    real* target = to + r * t.width + t.at;
    if (into == Into::overwrite && length == 4) {
      std::copy_n(source, 4, target);  // one move
    } else if (into == Into::overwrite) {
      std::copy_n(source, length, target);
    } else {
      for (Dim i = 0; i < length; ++i) target[i] += source[i];
    }
  }
}

// to[n, j, i] = or += from[n, i, j]
void transpose(Dim images, Dim rows, Dim columns, const real* from, Into into, real* to) {
  for (Dim n = 0; n < images; ++n, from += rows * columns, to += rows * columns) {
    for (Dim i = 0; i < rows; ++i) {
      for (Dim j = 0; j < columns; ++j) {
        real& element = to[j * rows + i];
        element = from[i * columns + j] + (into == Into::add ? element : 0);
      }
    }
  }
}

// x holding [images, rows, columns], y of `shape` holding [images, columns, rows];  gx is gy the other way
Variable transpose_inner(const char* op, const Variable& x, Dim images, Dim rows, Dim columns,
                         const Shape& shape) {
  Tensor y(shape);
  transpose(images, rows, columns, x.value().data(), Into::overwrite, y.data());
  return record(op, y, {&x}, [=](Backward& g) {
    if (const Backward::Slot gx = g.slot_of(0))
      transpose(images, columns, rows, g.gy().data(), gx.into, gx.data());
  });
}

// Calls visit(from, to) for each element of y with the place of the largest of its four elements of x: of
// the first among equal ones, of a NaN if there is one.
template <class Visit>
void for_each_maximum(const Tensor& x, Visit visit) {
  const Dim height = x.dim(1), width = x.dim(2), channels = x.dim(3);
  const real* value = x.data();
  Dim to = 0;
  for (Dim n = 0; n < x.dim(0); ++n) {
    for (Dim i = 0; i < height / 2; ++i) {
      for (Dim j = 0; j < width / 2; ++j) {
        for (Dim c = 0; c < channels; ++c) {
          const Dim corner = ((n * height + 2 * i) * width + 2 * j) * channels + c,
                    below = corner + width * channels;
          Dim best = corner;
          for (const Dim at : {corner + channels, below, below + channels}) {
            if (value[at] > value[best] || std::isnan(value[at])) best = at;
          }
          visit(best, to++);
        }
      }
    }
  }
}

}  // namespace

// x [N,H,W,C], y [N,H/2,W/2,C];  gx[where the largest was] += gy
Variable max_pool2d(const Variable& x) {
  check_rank("max_pool2d", "x", x, 4);
  if (x.dim(1) < 2 || x.dim(2) < 2) refuse("max_pool2d", "x", "H, W >= 2", x.shape().text());
  Tensor y(Shape{x.dim(0), x.dim(1) / 2, x.dim(2) / 2, x.dim(3)});
  for_each_maximum(x.value(), [&](Dim from, Dim to) { y.data()[to] = x.value().data()[from]; });
  return record("max_pool2d", y, {&x}, [](Backward& g) {
    Tensor* gx = g.grad_of(0);
    if (gx == nullptr) return;
    for_each_maximum(g.value(0), [&](Dim from, Dim to) { gx->data()[from] += g.gy().data()[to]; });
  });
}

// xs[i] [...,last i] -> y [..., sum of last i], side by side;  gx[i] += its columns of gy
Variable concat(std::span<const Variable> xs) {
  if (xs.empty() || xs.size() > kMaxInputs)
    refuse("concat", "xs", "1 to " + std::to_string(kMaxInputs) + " inputs", std::to_string(xs.size()));
  check_has_columns("concat", "x0", xs[0]);
  std::array<const Variable*, kMaxInputs> inputs{};
  Dim width = 0;
  for (std::size_t i = 0; i < xs.size(); ++i) {
    const std::string name = "x" + std::to_string(i);
    check_defined("concat", name.c_str(), xs[i]);
    const Dim last = xs[i].rank() < 1 ? 0 : xs[i].dim(xs[i].rank() - 1);
    check_shape("concat", name.c_str(), xs[i], with_last(xs[0].shape(), last));
    inputs[i] = &xs[i];
    width += last;
  }
  Tensor y(with_last(xs[0].shape(), width));
  const Dim rows = width == 0 ? 0 : y.size() / width;
  Dim at = 0;
  for (const Variable& x : xs) {
    const Dim last = x.dim(x.rank() - 1);
    move_columns(rows, last, x.value().data(), {last, 0}, Into::overwrite, y.data(), {width, at});
    at += last;
  }
  return record("concat", y, std::span<const Variable* const>(inputs.data(), xs.size()),
                [rows, width, count = xs.size()](Backward& g) {
                  Dim from = 0;
                  for (std::size_t i = 0; i < count; ++i) {
                    const Shape& shape = g.value(i).shape();
                    const Dim last = shape[shape.rank() - 1];
                    if (const Backward::Slot gx = g.slot_of(i))
                      move_columns(rows, last, g.gy().data(), {width, from}, gx.into, gx.data(), {last, 0});
                    from += last;
                  }
                });
}

static void check_runs(const Variable& x, const Runs& r) {
  check_has_columns("take_runs", "x", x);
  check_no_gradient("take_runs", "x", x);
  if (r.first < 0 || r.run < 1 || r.step < r.run || r.width < r.run || r.width % r.run != 0)
    refuse("take_runs", "runs", "first >= 0, run >= 1, step >= run and width a multiple of run",
           std::to_string(r.first) + ", " + std::to_string(r.run) + ", " + std::to_string(r.step) + " and " +
               std::to_string(r.width));
  const Dim end = r.first + (r.width / r.run - 1) * r.step + r.run;
  if (end > x.dim(x.rank() - 1))
    refuse("take_runs", "x", std::to_string(end) + " columns or more", x.shape().text());
}

// x [...,columns] -> y [...,width]: from column `first` on `run` columns, and so on every `step` columns
Variable take_runs(const Variable& x, const Runs& r) {
  check_runs(x, r);
  const Dim width = x.dim(x.rank() - 1);
  Tensor y(with_last(x.shape(), r.width));
  const Dim rows = x.size() / width;
  for (Dim at = 0; at < r.width; at += r.run) {
    move_columns(rows, r.run, x.value().data(), {width, r.first + at / r.run * r.step}, Into::overwrite,
                 y.data(), {r.width, at});
  }
  const OpSettings settings{.first = r.first, .run = r.run, .step = r.step};
  return record(
      "take_runs", y, {&x}, [](Backward&) {}, &settings);
}

// windows [N,T,rows * columns * channels] -> y [N,rows,columns,channels], the last of T
Variable last_frame(const Variable& x, Dim rows, Dim columns, Dim channels) {
  check_rank("last_frame", "windows", x, 3);
  check_at_least("last_frame", "rows", rows, 1);
  check_at_least("last_frame", "columns", columns, 1);
  check_at_least("last_frame", "channels", channels, 1);
  const Dim images = x.dim(0), frames = x.dim(1), signals = rows * columns * channels;
  check_shape("last_frame", "windows", x, {images, std::max<Dim>(frames, 1), signals});
  check_no_gradient("last_frame", "windows", x);
  Tensor y(Shape{images, rows, columns, channels});
  move_columns(images, signals, x.value().data(), {frames * signals, (frames - 1) * signals}, Into::overwrite,
               y.data(), {signals, 0});
  return record("last_frame", y, {&x}, [](Backward&) {});
}

// x [N,P...,C] -> y [N, C * pixels];  gx is gy the other way
Variable flatten_channels_first(const Variable& x) {
  check_defined("flatten_channels_first", "x", x);
  if (x.rank() < 3) refuse("flatten_channels_first", "x", "rank 3 or 4", x.shape().text());
  const Dim channels = x.dim(x.rank() - 1), images = x.dim(0);
  const Dim pixels = x.rank() == 3 ? x.dim(1) : x.dim(1) * x.dim(2);
  return transpose_inner("flatten_channels_first", x, images, pixels, channels, {images, channels * pixels});
}

// x [N, C * pixels] -> y [N,P...,C];  gx is gy the other way
Variable unflatten_channels_first(const Variable& x, std::span<const Dim> pixels) {
  check_rank("unflatten_channels_first", "x", x, 2);
  if (pixels.empty() || pixels.size() > 2)
    refuse("unflatten_channels_first", "pixels", "{L} or {H,W}", std::to_string(pixels.size()) + " sizes");
  for (const Dim side : pixels) check_at_least("unflatten_channels_first", "pixels", side, 1);
  const Dim count = pixels.size() == 1 ? pixels[0] : pixels[0] * pixels[1];
  if (x.dim(1) % count != 0)
    refuse("unflatten_channels_first", "x", "a multiple of " + std::to_string(count) + " columns",
           x.shape().text());
  const Dim images = x.dim(0), channels = x.dim(1) / count;
  const Shape shape =
      pixels.size() == 1 ? Shape{images, pixels[0], channels} : Shape{images, pixels[0], pixels[1], channels};
  return transpose_inner("unflatten_channels_first", x, images, channels, count, shape);
}

}  // namespace supertac
