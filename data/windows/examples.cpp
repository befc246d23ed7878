#include "data/windows/examples.h"

#include <vector>

namespace supertac {

Zone Examples::zone(std::size_t i) const {
  std::vector<float> pixels(image().pixels());
  target(i, pixels);
  return in_contact(pixels) ? Zone::contact : Zone::flat;
}

}  // namespace supertac
