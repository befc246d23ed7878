// ---- 10. The weights by their names in a checkpoint: made when first asked for, within 1 / sqrt(fan_in).
std::map<std::string, Tensor> weights;
std::mt19937_64 bits(1);
double uniform() { return double(bits() >> 11) * 0x1p-53; }
double normal() { return std::sqrt(-2 * std::log(1 - uniform())) * std::cos(2 * M_PI * uniform()); }
Tensor weight(const std::string& name, int size, double fan_in) {
  Tensor& w = weights[name];
  if (!w)
    for (double& at : (w = tensor({size}))->value) at = (2 * uniform() - 1) / std::sqrt(fan_in);
  if (w->size() != size) throw std::runtime_error(name + ": the file has another size");
  return w;
}
Tensor layer(const std::string& name, const Tensor& x, int outputs, Kernel k, Term (*f)(In) = same) {
  // Your part: the weight NAME.weight, the convolution, the bias NAME.bias of each output, then f.
  (void)k, (void)f;
  return tensor({outputs, x->h, x->w});
}
// A safetensors file: 8 bytes, the length of a JSON object that says where tensors lie, and their bytes.
void load(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  const std::string all((std::istreambuf_iterator<char>(file)), {}), key = "\"data_offsets\":[";
  std::size_t length = 0, first = 0, last = 0;
  if (all.size() >= 8) std::copy_n(all.data(), 8, reinterpret_cast<char*>(&length));
  if (length == 0 || length > all.size() - 8) throw std::runtime_error(path + ": no safetensors file");
  const std::string header = all.substr(8, length), data = all.substr(8 + length);
  for (std::size_t at = header.find(key); at != std::string::npos; at = header.find(key, at + 1)) {
    const auto end = header.rfind("\":{", at), start = header.rfind('"', end - 1) + 1;
    std::sscanf(header.c_str() + at + key.size(), "%zu,%zu", &first, &last);
    if (last < first || last > data.size()) throw std::runtime_error(path + ": it is cut off");
    std::vector<float> v((last - first) / sizeof(float));
    std::copy_n(&data[first], v.size() * sizeof(float), reinterpret_cast<char*>(v.data()));
    weights[header.substr(start, end - start)] = tensor({int(v.size())}, Array(v.begin(), v.end()));
  }
}
