#include "autograd/ops/shaping.h"

#include <algorithm>
#include <array>

#include "autograd/kernels/shaping.h"
#include "autograd/record.h"
#include "autograd/trace.h"

namespace supertac {

using kernels::move_columns;

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

// x holding [images, rows, columns], y of `shape` holding [images, columns, rows];  gx is gy the other way
Variable transpose_inner(const char* op, const Variable& x, Dim images, Dim rows, Dim columns,
                         const Shape& shape) {
  Tensor y(shape);
  kernels::transpose(images, rows, columns, x.value().data(), {y.data(), Into::overwrite});
  return record(op, y, {&x},
                [=](Backward& g) { kernels::transpose(images, columns, rows, g.gy().data(), g.slot_of(0)); });
}

}  // namespace

// x [N,H,W,C], y [N,H/2,W/2,C];  gx[where the largest was] = or += gy
Variable max_pool2d(const Variable& x) {
  check_rank("max_pool2d", "x", x, 4);
  if (x.dim(1) < 2 || x.dim(2) < 2) refuse("max_pool2d", "x", "H, W >= 2", x.shape().text());
  Tensor y(Shape{x.dim(0), x.dim(1) / 2, x.dim(2) / 2, x.dim(3)});
  kernels::max_pool2d(x.shape(), x.value().data(), y.data());
  return record("max_pool2d", y, {&x}, [](Backward& g) {
    kernels::max_pool2d_grad(g.value(0).shape(), g.value(0).data(), g.gy().data(), g.slot_of(0));
  });
}

// xs[i] [...,last i] -> y [..., sum of last i], side by side;  gx[i] = or += its columns of gy
Variable concat(std::span<const Variable> xs) {
  if (xs.empty() || xs.size() > kMaxInputs)
    refuse("concat", "xs", "1 to " + std::to_string(kMaxInputs) + " inputs", std::to_string(xs.size()));
  check_has_columns("concat", "x0", xs[0]);
  std::array<const Variable*, kMaxInputs> inputs{};
  Dim width = 0;
  for (std::size_t i = 0; i < xs.size(); ++i) {
    const std::string name = "x" + std::to_string(i);
    check_rank("concat", name.c_str(), xs[i], xs[0].rank());
    const Dim last = xs[i].dim(xs[i].rank() - 1);
    check_shape("concat", name.c_str(), xs[i], with_last(xs[0].shape(), last));
    inputs[i] = &xs[i];
    width += last;
  }
  Tensor y(with_last(xs[0].shape(), width));
  const Dim rows = width == 0 ? 0 : y.size() / width;
  Dim at = 0;
  for (const Variable& x : xs) {
    const Dim last = x.dim(x.rank() - 1);
    move_columns(rows, last, x.value().data(), {last, 0}, {y.data(), Into::overwrite}, {width, at});
    at += last;
  }
  return record("concat", y, std::span<const Variable* const>(inputs.data(), xs.size()),
                [rows, width, count = xs.size()](Backward& g) {
                  Dim from = 0;
                  for (std::size_t i = 0; i < count; ++i) {
                    const Shape& shape = g.value(i).shape();
                    const Dim last = shape[shape.rank() - 1];
                    move_columns(rows, last, g.gy().data(), {width, from}, g.slot_of(i), {last, 0});
                    from += last;
                  }
                });
}

// x [...,columns] -> y [...,width]: from column `first` on `run` columns, and so on every `step` columns
Variable take_runs(const Variable& x, const Runs& r) {
  check_has_columns("take_runs", "x", x);
  check_no_gradient("take_runs", "x", x);
  const Dim columns = x.dim(x.rank() - 1);
  check_between("take_runs", "first", r.first, 0, columns);
  check_between("take_runs", "run", r.run, 1, std::max<Dim>(columns, 1));
  check_at_least("take_runs", "step", r.step, r.run);
  check_between("take_runs", "width", r.width, r.run, std::max(columns, r.run));
  if (r.width % r.run != 0)
    refuse("take_runs", "width", "a multiple of run, " + std::to_string(r.run), std::to_string(r.width));
  const Dim room = columns - r.first - r.run;  // behind the first run; a product with `step` may overflow
  if (room < 0 || r.width / r.run - 1 > room / r.step)
    refuse("take_runs", "x", "columns for all runs", x.shape().text());
  Tensor y(with_last(x.shape(), r.width));
  const Dim rows = x.size() / columns;
  for (Dim at = 0; at < r.width; at += r.run)
    move_columns(rows, r.run, x.value().data(), {columns, r.first + at / r.run * r.step},
                 {y.data(), Into::overwrite}, {r.width, at});
  const OpSettings settings{.first = r.first, .run = r.run, .step = r.step};
  return record(
      "take_runs", y, {&x}, [](Backward&) {}, &settings);
}

// x [N,T,rows * columns * channels] -> y [N,rows,columns,channels], the last of T
Variable last_frame(const Variable& x, Dim rows, Dim columns, Dim channels) {
  check_rank("last_frame", "windows", x, 3);
  const Dim images = x.dim(0), frames = x.dim(1);
  if (frames < 1 || x.dim(2) < 1) refuse("last_frame", "windows", "[N,T,S] with T, S >= 1", x.shape().text());
  check_between("last_frame", "rows", rows, 1, x.dim(2));
  check_between("last_frame", "columns", columns, 1, x.dim(2) / rows);
  check_between("last_frame", "channels", channels, 1, x.dim(2) / (rows * columns));
  const Dim signals = rows * columns * channels;
  check_shape("last_frame", "windows", x, {images, frames, signals});
  check_no_gradient("last_frame", "windows", x);
  Tensor y(Shape{images, rows, columns, channels});
  move_columns(images, signals, x.value().data(), {frames * signals, (frames - 1) * signals},
               {y.data(), Into::overwrite}, {signals, 0});
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
  constexpr Dim kMostSide = 1 << 30;  // of two, whose product is a number
  for (const Dim side : pixels) check_between("unflatten_channels_first", "pixels", side, 1, kMostSide);
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
