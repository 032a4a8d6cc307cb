#pragma once

#include <string_view>

namespace etendue {

/// The first bytes of files of sections; see section_file.h.
inline constexpr std::string_view kSectionMark = "ETENDUE\x1a";

}  // namespace etendue
