// Whether the tests were built with a sanitizer: then programs are slow, memory says nothing, and limits of
// it cannot be set.
#pragma once

namespace supertac {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kSanitized = true;
#else
inline constexpr bool kSanitized = false;
#endif

}  // namespace supertac
