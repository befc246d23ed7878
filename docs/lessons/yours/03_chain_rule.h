// ---- 3. The chain rule: the reverse steps of the ops, in their order. A step runs when the gradient of its
// result is complete, and adds to those of what that was made from: a value used twice has two of them.
std::vector<std::function<void()>> tape;
void backward(const Tensor& loss) {
  loss->grad[0] = 1;
  // Your part: the steps, in which order?
  tape.clear();
}
// Most ops meet elements one by one: a term of the i-th element of each input. Smaller inputs are repeated,
// and terms of smaller results are added up: a gate serves all pixels of its channel, a loss is one number.
template <class F>
Tensor each(Shape shape, const std::vector<Tensor>& xs, F term) {
  int n = shape.size();
  for (const Tensor& x : xs) n = std::max(n, x->size());
  const auto term_of = [=](int i) {
    double a[5];
    for (std::size_t k = 0; k < xs.size(); ++k) a[k] = xs[k]->value[i / (n / xs[k]->size())];
    return term(a);
  };
  const Tensor y = tensor(shape);
  for (int i = 0; i < n; ++i) y->value[i / (n / y->size())] += term_of(i)[0];
  tape.push_back([=] {
    // Your part: y->grad is complete. Add to xs[k]->grad for each term that was added up above.
  });
  return y;
}
Tensor add(const Tensor& x, double k, const Tensor& y) {  // x + k y
  return each(*x, {x, y}, [k](In a) { return Term{a[0] + k * a[1], 1, k}; });
}
