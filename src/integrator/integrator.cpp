#include "integrator/integrator.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <stdexcept>
#include <string_view>

#include <fmt/format.h>

#include "integrator/auto.h"
#include "integrator/bdpt.h"
#include "integrator/light.h"
#include "integrator/mlt.h"
#include "integrator/mmlt.h"
#include "integrator/mps.h"
#include "integrator/path.h"
#include "integrator/pcbpt.h"
#include "integrator/pm.h"
#include "integrator/pssmlt.h"
#include "integrator/sppm.h"
#include "integrator/upg.h"
#include "integrator/upg_pssmlt.h"
#include "integrator/vcm.h"

namespace etendue {

const std::vector<IntegratorEntry>& integrator_registry() {
    static const std::vector<IntegratorEntry> entries = {
        path_entry(),   light_entry(), bdpt_entry(), pm_entry(),       ppm_entry(),
        sppm_entry(),   vcm_entry(),   upg_entry(),  upg_bdpt_entry(), pcbpt_entry(),
        pssmlt_entry(), mmlt_entry(),  mlt_entry(),  mps_entry(),      upg_pssmlt_entry()};
    return entries;
}

namespace {

/// The items between commas. A comma in a value, such as the name of a file, follows a backslash, and so does a backslash.
std::vector<std::string> split_items(std::string_view text) {
    std::vector<std::string> items(1);
    for (size_t i = 0; i < text.size(); ++i)
        if (text[i] == '\\' && i + 1 < text.size() && (text[i + 1] == ',' || text[i + 1] == '\\'))
            items.back() += text[++i];
        else if (text[i] == ',')
            items.emplace_back();
        else
            items.back() += text[i];
    return items;
}

}  // namespace

IntegratorSpec IntegratorSpec::parse(const std::string& text) {
    IntegratorSpec spec;
    const size_t colon = text.find(':');
    spec.name = text.substr(0, colon);
    if (colon == std::string::npos || colon + 1 == text.size()) return spec;
    std::vector<std::string> items = split_items(std::string_view(text).substr(colon + 1));
    if (items.back().empty()) items.pop_back();
    for (const std::string& item : items) {
        const size_t equals = item.find('=');
        if (equals == std::string::npos || equals == 0)
            throw std::runtime_error(fmt::format(
                "integrator \"{}\": expected name=value after ':' or ',', but found \"{}\"",
                spec.name, item));
        if (!spec.params.emplace(item.substr(0, equals), item.substr(equals + 1)).second)
            throw std::runtime_error(
                fmt::format("integrator \"{}\": parameter \"{}\" is given twice", spec.name,
                            item.substr(0, equals)));
    }
    return spec;
}

std::string IntegratorSpec::to_string() const {
    std::string text = name;
    char separator = ':';
    for (const auto& [key, value] : params) {
        text += separator + key + '=';
        for (const char c : value) {
            if (c == ',' || c == '\\') text += '\\';
            text += c;
        }
        separator = ',';
    }
    return text;
}

IntegratorParams::IntegratorParams(const IntegratorSpec& spec, const PluginInfo& info)
    : integrator_(spec.name), guide_(spec.guide), shared_by_pilots_(spec.shared_by_pilots) {
    std::vector<std::string> known;
    for (const ParamInfo& p : info.params) {
        values_[p.name] = p.fallback;
        known.push_back(p.name);
    }
    for (const auto& [key, value] : spec.params) {
        if (!values_.count(key)) {
            if (key == "spp" || key == "samples" || key == "sample_count")
                throw std::runtime_error(fmt::format("integrator \"{}\" has no parameter \"{}\" "
                                                     "(the number of samples is an option of "
                                                     "its own: --spp)",
                                                     spec.name, key));
            const std::string near = nearest_name(key, known);
            throw std::runtime_error(
                fmt::format("integrator \"{}\" has no parameter \"{}\" ({})", spec.name, key,
                            near.empty() ? fmt::format("it has: {}", fmt::join(known, ", "))
                                         : fmt::format("did you mean \"{}\"?", near)));
        }
        values_[key] = value;
    }
}

const std::string& IntegratorParams::text(const char* name) const {
    return values_.at(name);
}

namespace {

[[noreturn]] void refuse(const std::string& integrator, const char* name, const std::string& text,
                         const char* kind) {
    throw std::runtime_error(
        fmt::format("integrator \"{}\": parameter \"{}\" must be {}, but is \"{}\"", integrator,
                    name, kind, text));
}

template <class T>
T parse_number(const std::string& integrator, const char* name, const std::string& text,
               const char* kind) {
    T value{};
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size())
        refuse(integrator, name, text, kind);
    return value;
}

}  // namespace

int IntegratorParams::integer(const char* name) const {
    return parse_number<int>(integrator_, name, text(name), "an integer");
}

float IntegratorParams::number(const char* name) const {
    const float value = parse_number<float>(integrator_, name, text(name), "a finite number");
    if (!std::isfinite(value)) refuse(integrator_, name, text(name), "a finite number");
    return value;
}

bool IntegratorParams::flag(const char* name) const {
    const std::string& t = text(name);
    if (t != "true" && t != "false")
        throw std::runtime_error(
            fmt::format("integrator \"{}\": parameter \"{}\" must be true or false, but is \"{}\"",
                        integrator_, name, t));
    return t == "true";
}

void IntegratorParams::refuse_choice(const char* name,
                                     const std::vector<std::string>& known) const {
    throw std::runtime_error(
        fmt::format("integrator \"{}\": parameter \"{}\" must be one of {}, but is \"{}\"",
                    integrator_, name, fmt::join(known, ", "), text(name)));
}

namespace {

template <class T>
T checked_range(const std::string& integrator, const char* name, T value, T low, T high) {
    if (!(value >= low && value <= high))
        throw std::runtime_error(
            fmt::format("integrator \"{}\": parameter \"{}\" must lie in [{}, {}], but is {}",
                        integrator, name, low, high, value));
    return value;
}

}  // namespace

int IntegratorParams::integer(const char* name, int low, int high) const {
    return checked_range(integrator_, name, integer(name), low, high);
}

float IntegratorParams::number(const char* name, float low, float high) const {
    return checked_range(integrator_, name, number(name), low, high);
}

namespace {

/// What an integrator is called elsewhere.
struct OtherName {
    const char *other, *name;
};
constexpr OtherName kOtherNames[] = {{"pt", "path"},
                                     {"pathtracer", "path"},
                                     {"pathtracing", "path"},
                                     {"volpath", "path"},
                                     {"direct", "path"},
                                     {"lt", "light"},
                                     {"ptracer", "light"},
                                     {"lighttracer", "light"},
                                     {"lighttracing", "light"},
                                     {"particle", "light"},
                                     {"bpt", "bdpt"},
                                     {"bidir", "bdpt"},
                                     {"bidirectional", "bdpt"},
                                     {"photonmapper", "pm"},
                                     {"photonmap", "pm"},
                                     {"photonmapping", "pm"},
                                     {"photon", "pm"},
                                     {"vcmups", "vcm"},
                                     {"ups", "vcm"},
                                     {"metropolis", "mlt"},
                                     {"veach", "mlt"},
                                     {"kelemen", "pssmlt"},
                                     {"pssmltbdpt", "pssmlt"},
                                     {"multiplexed", "mmlt"},
                                     {"upgbdpt", "upg+bdpt"},
                                     {"upgpssmlt", "upg+pssmlt"},
                                     {"gathering", "upg"}};

/// The integrator that is probably meant; empty if none is near.
std::string meant_integrator(const std::string& given, const std::vector<std::string>& known) {
    std::string letters;
    for (const char c : given)
        if (std::isalnum(static_cast<unsigned char>(c)))
            letters += char(std::tolower(static_cast<unsigned char>(c)));
    for (const std::string& name : known)
        if (letters == name) return name;
    for (const OtherName& n : kOtherNames)
        if (letters == n.other) return n.name;
    return nearest_name(given, known);
}

}  // namespace

const IntegratorEntry& integrator_entry(const std::string& name) {
    if (name == auto_entry().info.name) return auto_entry();
    std::vector<std::string> known{auto_entry().info.name};
    for (const IntegratorEntry& e : integrator_registry()) {
        if (name == e.info.name) return e;
        known.push_back(e.info.name);
    }
    const std::string first = name.substr(0, name.find_first_of(" ,;=("));
    if (first != name && std::ranges::find(known, first) != known.end())
        throw std::runtime_error(fmt::format(
            "there is no integrator \"{}\"; parameters follow a colon and are separated "
            "by commas: {}:max_depth=8,...",
            name, first));
    const std::string near = meant_integrator(name, known);
    throw std::runtime_error(fmt::format(
        "there is no integrator \"{}\"; {}there are: {}", name,
        near.empty() ? "" : fmt::format("did you mean \"{}\"? ", near), fmt::join(known, ", ")));
}

std::unique_ptr<Integrator> make_integrator(const IntegratorSpec& spec) {
    if (spec.make) return spec.make(spec.params);
    const IntegratorEntry& entry = integrator_entry(spec.name);
    return entry.make(IntegratorParams(spec, entry.info));
}

DepthOptions DepthOptions::from(const IntegratorParams& params) {
    const int max_depth = params.integer("max_depth");
    if (max_depth < -1 || max_depth == 0)
        throw std::runtime_error("max_depth must be -1 (unlimited) or at least 1");
    DepthOptions depth{max_depth < 0 ? kUnlimited : std::min(max_depth, kUnlimited), kUnlimited,
                       params.has("rr_depth")};
    if (!depth.has_roulette) return depth;
    depth.rr_depth = params.integer("rr_depth");
    if (depth.rr_depth < 1) throw std::runtime_error("rr_depth must be at least 1");
    constexpr int kLatestRoulette = RenderDefaults::kLatestRoulette;
    if (depth.rr_depth > kLatestRoulette && depth.max_depth > kLatestRoulette)
        throw std::runtime_error(fmt::format(
            "rr_depth is {}, but must be at most {}, unless max_depth is: paths in a closed room "
            "would not end",
            depth.rr_depth, kLatestRoulette));
    return depth;
}

std::vector<ParamInfo> depth_params(const char* rr_depth) {
    return {
        {"max_depth", ParamKind::Int, "-1",
         "Number of edges of the longest paths, at least 1 (1: only directly visible light); -1: "
         "no limit."},
        {"rr_depth", ParamKind::Int, rr_depth,
         "Index, at least 1, of the first vertex of a sub-path at which Russian roulette is "
         "applied; the lens or emitter has index 0."}};
}

std::vector<ParamInfo> sub_path_params() {
    return depth_params("2");
}

}  // namespace etendue
