#include "render/scene_integrator.h"

#include <algorithm>
#include <cstring>

#include <fmt/format.h>

#include "integrator/auto.h"
#include "scene/mitsuba_manual.h"
#include "scene/settings.h"

namespace etendue {
namespace {

using Use = MitsubaIntegratorParam::Use;

const ParamInfo* find_param(const std::vector<ParamInfo>& params, std::string_view name) {
    for (const ParamInfo& p : params)
        if (name == p.name) return &p;
    return nullptr;
}

const IntegratorEntry* find_entry(const std::string& name) {
    if (name == auto_entry().info.name) return &auto_entry();
    for (const IntegratorEntry& e : integrator_registry())
        if (name == e.info.name) return &e;
    return nullptr;
}

/// The parameters of an integrator in a scene file, under a name of Mitsuba or its own (alias: nullptr).
PluginInfo in_scene_files(const char* name, const PluginInfo& own, const IntegratorAlias* alias) {
    PluginInfo all{"integrator", name, alias ? alias->info.doc : own.doc, own.params};
    if (alias && alias->max_depth >= 0)
        std::erase_if(all.params, [](const ParamInfo& p) {
            return std::strcmp(p.name, "max_depth") == 0 || std::strcmp(p.name, "rr_depth") == 0;
        });
    for (const MitsubaIntegratorParam& p : alias ? alias->params : shared_integrator_params())
        if (!find_param(all.params, p.info.name)) all.params.push_back(p.info);
    return all;
}

/// A parameter as the text that an IntegratorSpec has.
std::string text_of(const Param& p) {
    if (const bool* flag = p.as<bool>()) return *flag ? "true" : "false";
    if (const int64_t* number = p.as<int64_t>()) return fmt::format("{}", *number);
    if (const double* number = p.as<double>()) return fmt::format("{}", *number);
    if (const std::string* text = p.as<std::string>()) return *text;
    return "";
}

std::string unknown_integrator(const std::string& type) {
    if (const ManualEntry* entry = find_manual_entry("integrator", type); entry && entry->refused)
        return fmt::format("integrator \"{}\" is not supported: {}", type, entry->refused);
    std::vector<std::string> known{auto_entry().info.name};
    for (const IntegratorEntry& e : integrator_registry()) known.push_back(e.info.name);
    const std::vector<std::string> own = known;
    for (const IntegratorAlias& a : integrator_aliases()) known.push_back(a.info.name);
    const std::string near = nearest_name(type, known);
    return near.empty()
               ? fmt::format("unknown integrator \"{}\" (known: {})", type, fmt::join(own, ", "))
               : fmt::format("unknown integrator \"{}\" (did you mean \"{}\"?)", type, near);
}

/// Reads the integrator of one scene.
class Reader {
public:
    explicit Reader(const Scene& scene)
        : scene_(scene), object_(*scene.defaults().integrator),
          is_lenient_(scene.defaults().is_lenient) {}

    SceneIntegrator read() {
        if (const std::string& problem = scene_.defaults().integrator_problem; !problem.empty())
            throw std::runtime_error(problem);
        alias_ = find_integrator_alias(object_.type);
        const bool is_wrapper = alias_ && !*alias_->integrator;
        const IntegratorEntry* entry = find_entry(is_wrapper ? "path"
                                                  : alias_   ? alias_->integrator
                                                             : object_.type);
        if (!entry) {
            problem(object_.where, unknown_integrator(object_.type), "path is rendered");
            return {{"path", {}}, warnings_};
        }
        IntegratorSpec& spec = found_.spec;
        spec.name = entry->info.name;
        if (is_wrapper) return found_;
        if (alias_ && alias_->is_substitute)
            warn(object_.where, fmt::format("integrator \"{}\" is not supported; {} is rendered",
                                            object_.type, spec.name));
        read_params(entry->info);
        limit_roulette();
        if (alias_ && alias_->max_depth >= 0)
            spec.params["max_depth"] = fmt::format("{}", alias_->max_depth);
        check_values();
        found_.warnings = warnings_;
        return found_;
    }

private:
    void warn(const SourceLocation& where, const std::string& message) {
        warnings_.push_back(SceneError(where, message).what());
    }
    void problem(const SourceLocation& where, const std::string& message, const char* instead) {
        if (!is_lenient_) throw SceneError(where, message);
        warn(where, fmt::format("{} ({})", message, instead));
    }

    void read_params(const PluginInfo& own) {
        const PluginInfo all = in_scene_files(object_.type.c_str(), own, alias_);
        const std::vector<MitsubaIntegratorParam>& foreign =
            alias_ ? alias_->params : shared_integrator_params();

        // Only values of the right type are read.
        SceneDescription alone;
        alone.objects = {object_};
        std::vector<const Param*> accepted;
        for (const Param& p : object_.params) {
            alone.objects[0].params = {p};
            bool is_valid = true;
            check_params(alone, 0, all, [&](const SourceLocation& where, const std::string& m) {
                is_valid = false;
                problem(where, m, "left out");
            });
            if (is_valid) accepted.push_back(&p);
        }
        for (const Param* p : accepted)
            if (find_param(own.params, p->name)) found_.spec.params[p->name] = text_of(*p);
        std::vector<std::string> ignored;
        for (const Param* p : accepted)
            if (!found_.spec.params.count(p->name))
                for (const MitsubaIntegratorParam& f : foreign)
                    if (p->name == f.info.name) read_foreign(*p, f, ignored);
        if (!ignored.empty())
            warn(object_.where,
                 fmt::format("integrator \"{}\": without counterpart here, and ignored: {}",
                             object_.type, fmt::join(ignored, ", ")));
    }

    void read_foreign(const Param& p, const MitsubaIntegratorParam& f,
                      std::vector<std::string>& ignored) {
        if (f.use == Use::Missing && text_of(p) != f.harmless)
            ignored.push_back(fmt::format("{}={}", p.name, text_of(p)));
        if (f.use != Use::Counterpart) return;
        std::string text = text_of(p);
        if (const int64_t* number = p.as<int64_t>(); number && f.most > 0 && *number > f.most) {
            warn(p.where, fmt::format("parameter \"{}\" is {}, but {} is at most {}, which is used",
                                      p.name, *number, f.counterpart, f.most));
            text = fmt::format("{}", f.most);
        }
        if (f.is_relative && !scene_.bounds().is_empty()) {
            const double* fraction = p.as<double>();
            const double of = fraction ? *fraction : double(*p.as<int64_t>());
            text = fmt::format("{}", float(of * double(scene_.bounds().radius())));
        }
        found_.spec.params.emplace(f.counterpart, text);
    }

    /// Files may ask for walks that would not end.
    void limit_roulette() {
        constexpr int64_t kLatest = RenderDefaults::kLatestRoulette;
        auto& params = found_.spec.params;
        const Param *rr_depth = object_.find("rr_depth"), *max_depth = object_.find("max_depth");
        const int64_t* given = rr_depth ? rr_depth->as<int64_t>() : nullptr;
        const int64_t* longest = max_depth ? max_depth->as<int64_t>() : nullptr;
        const bool is_limited = longest && *longest >= 0 && *longest <= kLatest;
        if (!given || *given <= kLatest || is_limited || !params.count("rr_depth")) return;
        warn(rr_depth->where,
             fmt::format("rr_depth is {}; {} is used, so that paths in closed rooms end", *given,
                         kLatest));
        params["rr_depth"] = fmt::format("{}", kLatest);
    }

    /// Finds values that are out of range, which only the integrator knows.
    void check_values() {
        try {
            make_integrator(found_.spec);
        } catch (const std::exception& e) {
            problem(object_.where, e.what(), "its parameters are left out");
            found_.spec.params.clear();
        }
    }

    const Scene& scene_;
    const SceneObject& object_;
    bool is_lenient_;
    const IntegratorAlias* alias_ = nullptr;
    SceneIntegrator found_;
    std::vector<std::string> warnings_;
};

}  // namespace

SceneIntegrator scene_integrator(const Scene& scene) {
    if (!scene.defaults().integrator) return {{auto_entry().info.name, {}}, {}};
    return Reader(scene).read();
}

std::vector<PluginInfo> scene_file_integrators() {
    std::vector<PluginInfo> all{in_scene_files(auto_entry().info.name, auto_entry().info, nullptr)};
    for (const IntegratorAlias& a : integrator_aliases()) {
        const IntegratorEntry* entry = find_entry(a.integrator);
        all.push_back(entry ? in_scene_files(a.info.name, entry->info, &a) : a.info);
    }
    for (const IntegratorEntry& e : integrator_registry())
        if (!find_integrator_alias(e.info.name))
            all.push_back(in_scene_files(e.info.name, e.info, nullptr));
    return all;
}

std::string name_of_integrator(const Scene& scene) try {
    return scene_integrator(scene).spec.name;
} catch (const std::exception&) {
    return "path";
}

std::vector<std::string> warnings_of(const Scene& scene, const std::string& integrator) {
    std::vector<std::string> all = scene.warnings();
    try {
        const SceneIntegrator own = scene_integrator(scene);
        if (integrator.empty() || IntegratorSpec::parse(integrator).name == own.spec.name)
            all.insert(all.end(), own.warnings.begin(), own.warnings.end());
    } catch (const std::exception&) {
        // choose_integrator() says what is wrong, if this integrator is chosen.
    }
    return all;
}

}  // namespace etendue
