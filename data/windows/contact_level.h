// From which level on a truth that was measured is contact.
#pragma once

#include <cstddef>
#include <span>

namespace supertac {

/// Of a truth [frames][pixels] that a film or a camera measured: its level at rest and six times its noise
/// there. Both are taken from the pixels of the tenth of the frames that sum to the least: their median, and
/// how far their 95th percentile lies above it, since noise is often cut off at 0. 0 where these frames are
/// fewer than three, or where they differ by more than a tenth of the range: then nothing rests.
float contact_level(std::span<const float> truth, std::size_t pixels);

}  // namespace supertac
