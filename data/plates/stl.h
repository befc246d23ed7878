// STL files: triangles in mm, written binary, read in both forms.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace supertac {

/// Corners counter-clockwise seen from outside, each (x, y, z) in mm.
using Triangle = std::array<std::array<float, 3>, 3>;

constexpr std::uint64_t kMaxStlBytes = 512 << 20;  ///< read and written
constexpr float kMaxStlCoordinateMm = 1e6F;        ///< beyond any printer, and a sum could overflow

/// The triangles of an STL file held in memory. A file is binary when its length is that of its count,
/// 84 + 50 n bytes, whatever its first word; else it is text when it begins with "solid", whatever case,
/// spaces or byte-order mark, and has no zero byte. Normals and attributes are not used; the text may hold
/// several solids, lines end with LF, CR or both, and what follows the last solid does not matter.
/// `name`: of the file, for messages
/// Throws FileError, naming the byte or the line: no STL, cut off, another count than the length allows, no
/// triangle, coordinates that are no numbers or beyond kMaxStlCoordinateMm. No count is believed before it
/// has been compared with the length.
std::vector<Triangle> parse_stl(std::span<const std::byte> bytes, const std::string& name);

/// The same from a file of at most kMaxStlBytes.
std::vector<Triangle> read_stl(const std::string& path);

/// A binary STL file's bytes, normals left at 0, which readers take from the corners (right-hand rule);
/// `title` goes into its 80-byte header. Throws std::invalid_argument for a title that begins with "solid",
/// by which readers would take the file for text, or more triangles than kMaxStlBytes hold.
std::vector<std::byte> stl_bytes(const std::vector<Triangle>& triangles, std::string_view title);

}  // namespace supertac
