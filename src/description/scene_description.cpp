#include "description/scene_description.h"

#include <algorithm>

namespace etendue {

SceneError::SceneError(const SourceLocation& where, const std::string& message)
    : std::runtime_error(where.file.empty()
                             ? message
                             : where.file.str() +
                                   (where.line > 0 ? ":" + std::to_string(where.line) : "") + ": " +
                                   message),
      where_(where), message_(message) {}

const Param* SceneObject::find(std::string_view param_name) const {
    const auto it = std::find_if(params.begin(), params.end(),
                                 [&](const Param& p) { return p.name == param_name; });
    return it == params.end() ? nullptr : &*it;
}

std::string nearest_name(std::string_view name, const std::vector<std::string>& candidates) {
    // Optimal string alignment distance, whatever the case of letters. A candidate is near if the distance is at most a
    // third of the name's length, or 1.
    const auto lower = [](char c) { return c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c; };
    auto distance = [&](std::string_view a, std::string_view b) {
        const auto differ = [&](char x, char y) { return lower(x) != lower(y); };
        std::vector<std::vector<size_t>> d(a.size() + 1, std::vector<size_t>(b.size() + 1));
        for (size_t i = 0; i <= a.size(); ++i) d[i][0] = i;
        for (size_t j = 0; j <= b.size(); ++j) d[0][j] = j;
        for (size_t i = 1; i <= a.size(); ++i)
            for (size_t j = 1; j <= b.size(); ++j) {
                const size_t substitute = d[i - 1][j - 1] + differ(a[i - 1], b[j - 1]);
                d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, substitute});
                if (i > 1 && j > 1 && !differ(a[i - 1], b[j - 2]) && !differ(a[i - 2], b[j - 1]))
                    d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
            }
        return d[a.size()][b.size()];
    };
    std::string best;
    size_t best_distance = std::max<size_t>(1, name.size() / 3) + 1;
    for (const std::string& c : candidates) {
        const size_t k = distance(name, c);
        if (k < best_distance) best_distance = k, best = c;
    }
    return best;
}

}  // namespace etendue
