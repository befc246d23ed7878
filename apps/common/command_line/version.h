#pragma once

namespace supertac {

/// The commit the program was built from, "-dirty" when the tree had changes; "unknown" without git. Defined
/// in a file that the build writes.
const char* commit();

}  // namespace supertac
