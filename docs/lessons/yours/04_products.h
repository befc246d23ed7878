// ---- 4. Products: y[c] += w[a] x[b] for each {a, b, c}. Linear layers and convolutions consist of them.
using Products = std::vector<std::array<int, 3>>;
Tensor bilinear(Shape shape, const Tensor& w, const Tensor& x, const Products& products) {
  const Tensor y = tensor(shape);
  for (const auto& [a, b, c] : products) y->value[c] += w->value[a] * x->value[b];
  tape.push_back([=, &products] {
    // Your part: w and x get their gradients from y->grad.
  });
  return y;
}
