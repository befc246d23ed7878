// ---- 6. Channel attention: each channel is looked at by its mean, and weighed.
Term gated(In a) { return {a[0] + a[1] * a[2], 0, 0, 0}; }
Tensor channel_mean(const Tensor& x) {
  return tensor({x->c});  // Your part: the mean of each channel
}
