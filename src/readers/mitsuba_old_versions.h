#pragma once
// Scenes of Mitsuba 0.1 to 0.3 in the words of Mitsuba 0.4.

#include <array>

#include <pugixml.hpp>

namespace etendue {

/// Renames what Mitsuba's own upgrades from versions before 0.3.0 and 0.4.0 rename, in the document of which `root` is
/// the root element. Nothing is changed where the version is 0.4.0 or newer.
void upgrade_old_version(pugi::xml_node root, const std::array<int, 3>& version);

}  // namespace etendue
