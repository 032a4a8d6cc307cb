#pragma once
// Figures of renderings, as messages show them.

#include <string>

#include "film/film.h"

namespace etendue {

std::string format_seconds(double seconds);
/// What follows other figures: ", relative error 0.0123 (95 %: 0.0110 to 0.0136)", or "" if it is unknown.
std::string format_error(const ErrorEstimate& error);

}  // namespace etendue
