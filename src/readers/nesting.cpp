#include "readers/nesting.h"

#include <algorithm>
#include <iterator>

#include <fmt/format.h>

namespace etendue {
namespace {

/// The categories of objects, and those that may stand in each.
struct Nesting {
    const char* category;
    const char* children;
};
constexpr Nesting kNesting[] = {
    {"bsdf", "bsdf texture phase medium"},
    {"emitter", "texture medium"},
    {"film", "rfilter"},
    {"integrator", "integrator sampler texture"},
    {"medium", "phase texture volume"},
    {"phase", "phase texture"},
    {"rfilter", ""},
    {"sampler", ""},
    {"sensor", "film medium sampler sensor shape"},
    {"shape", "bsdf emitter medium sensor shape subsurface texture"},
    {"texture", "texture volume"},
    {"volume", "texture volume"},
    {"spectrum", ""},
    {"subsurface", "phase texture volume"},
};

const Nesting* find_nesting(std::string_view category) {
    const auto it = std::find_if(std::begin(kNesting), std::end(kNesting),
                                 [&](const Nesting& n) { return n.category == category; });
    return it == std::end(kNesting) ? nullptr : it;
}

}  // namespace

std::vector<std::string> object_categories() {
    std::vector<std::string> all;
    for (const Nesting& n : kNesting) all.push_back(n.category);
    return all;
}

bool is_category(std::string_view name) {
    return name != "spectrum" && find_nesting(name);
}

bool has_word(std::string_view words, std::string_view word) {
    for (size_t at = words.find(word); at != words.npos; at = words.find(word, at + 1)) {
        const size_t end = at + word.size();
        if ((at == 0 || words[at - 1] == ' ') && (end == words.size() || words[end] == ' '))
            return true;
    }
    return false;
}

void check_nesting(std::string_view parent, std::string_view child, const SourceLocation& where) {
    if (parent == "scene") return;
    const char* allowed = find_nesting(parent)->children;
    if (has_word(allowed, child)) return;
    throw SceneError(where, *allowed ? fmt::format("a <{}> cannot stand in a <{}>, which takes: {}",
                                                   child, parent, allowed)
                                     : fmt::format("a <{}> cannot stand in a <{}>", child, parent));
}

}  // namespace etendue
