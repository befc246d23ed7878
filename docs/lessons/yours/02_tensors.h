// ---- 2. Tensors: an array [c][h][w] and its gradient. Signals have h = 1, vectors h = w = 1.
using Array = std::vector<double>;
struct Shape {
  int c, h = 1, w = 1;
  int size() const { return c; }
};
struct Node : Shape {
  Array value = Array(std::size_t(size())), grad = value, m = value, v = value;  // m, v: Adam's, of weights
};
using Tensor = std::shared_ptr<Node>;
Tensor tensor(Shape shape, const Array& values = {}) {
  auto x = std::make_shared<Node>(Node{shape});
  std::copy(values.begin(), values.end(), x->value.begin());
  return x;
}
const Tensor one = tensor({1}, {1});
