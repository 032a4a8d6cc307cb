#pragma once
// Which objects of a Mitsuba scene may stand in which others.

#include <string>
#include <string_view>
#include <vector>

#include "description/source_location.h"

namespace etendue {

/// "bsdf", "emitter", ..., and "spectrum", which becomes a parameter.
std::vector<std::string> object_categories();
/// Whether objects of this category are part of a description.
bool is_category(std::string_view name);
/// Throws SceneError where a `child` cannot stand in a `parent`; everything may stand in a "scene".
void check_nesting(std::string_view parent, std::string_view child, const SourceLocation& where);

/// Whether `word` is one of the words of a list that are separated by blanks.
bool has_word(std::string_view words, std::string_view word);

}  // namespace etendue
