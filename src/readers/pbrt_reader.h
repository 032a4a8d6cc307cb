#pragma once
// The machine behind pbrt.h: one object reads one scene, directive by directive.

#include <deque>
#include <string>
#include <string_view>
#include <vector>

#include "readers/pbrt_scene.h"

namespace etendue {

class PbrtReader {
public:
    /// `options` must outlive the reader.
    PbrtReader(const std::string& file, const ReadOptions& options) : scene_(file, options) {}
    /// Reads the scene of which `text` is the main file; to be called once.
    SceneDescription read(std::string_view text);

private:
    enum class Place { Options, World, Anywhere };  ///< Before or after WorldBegin.
    struct Directive {
        std::string_view name;
        int versions;
        Place place;
        void (PbrtReader::*read)(PbrtTokenizer& in);
    };
    static const std::vector<Directive> kDirectives;

    struct OpenFile {
        std::string path, text;  ///< The main file and imported ones store their text elsewhere.
    };
    void read_file(std::string_view text, const std::string& path);
    /// Forgets the included files that the tokenizer has left.
    void close_files(const PbrtTokenizer& in);
    OpenFile load_included(PbrtTokenizer& in);
    void read_directive(PbrtTokenizer& in, std::string_view word);

    void identity(PbrtTokenizer&);
    void translate(PbrtTokenizer& in);
    void scale(PbrtTokenizer& in);
    void rotate(PbrtTokenizer& in);
    void look_at(PbrtTokenizer& in);
    void transform(PbrtTokenizer& in);
    void concat_transform(PbrtTokenizer& in);
    void coordinate_system(PbrtTokenizer& in);
    void coord_sys_transform(PbrtTokenizer& in);
    void active_transform(PbrtTokenizer& in);
    void transform_times(PbrtTokenizer& in);
    void transform_begin(PbrtTokenizer& in);
    void transform_end(PbrtTokenizer& in);
    void attribute_begin(PbrtTokenizer& in);
    void attribute_end(PbrtTokenizer& in);
    void attribute(PbrtTokenizer& in);
    void reverse_orientation(PbrtTokenizer&);
    void medium_interface(PbrtTokenizer& in);
    void make_named_medium(PbrtTokenizer& in);
    void texture(PbrtTokenizer& in);
    void material(PbrtTokenizer& in);
    void make_named_material(PbrtTokenizer& in);
    void named_material(PbrtTokenizer& in);
    void light_source(PbrtTokenizer& in);
    void area_light_source(PbrtTokenizer& in);
    void shape(PbrtTokenizer& in);
    void object_begin(PbrtTokenizer& in);
    void object_end(PbrtTokenizer& in);
    void object_instance(PbrtTokenizer& in);
    void include(PbrtTokenizer& in);
    void import(PbrtTokenizer& in);
    void camera(PbrtTokenizer& in);
    void film(PbrtTokenizer& in);
    void pixel_filter(PbrtTokenizer& in);
    void sampler(PbrtTokenizer& in);
    void integrator(PbrtTokenizer& in);
    void accelerator(PbrtTokenizer& in);
    void option(PbrtTokenizer& in);
    void color_space(PbrtTokenizer& in);
    void world_begin(PbrtTokenizer& in);
    void world_end(PbrtTokenizer& in);

    /// `"name" parameters` after the directive `kind`; the defaults are those of pbrt-v4's Attribute.
    PbrtArguments arguments(PbrtTokenizer& in, const char* kind, const char* defaults = "");
    /// What a directive names: made by its table's entry. Refused or unknown ones are -1 under `lenient`.
    int make(PbrtArguments& args, const std::vector<PbrtEntry>& table, const std::string& stand_in);
    /// Type of a named material or medium, taken out of its parameters.
    PbrtArguments take_type(PbrtArguments args, const char* kind);
    int make_material(PbrtArguments& args);
    void push(const char* what, PbrtPlace where);
    void pop(const char* what, const char* closing, PbrtPlace where);
    void make_view();
    void finish(const SourceLocation& end);

    struct Saved {
        const char* what;  ///< "AttributeBegin", ...
        PbrtPlace where;
        PbrtState state;
    };

    PbrtScene scene_;
    std::vector<Saved> stack_;
    std::map<std::string, Transform> coordinate_systems_;
    std::vector<std::pair<std::string, PbrtPlace>> not_yet_made_;  ///< Of NamedMaterial.
    PbrtArguments camera_, film_, filter_, sampler_, integrator_;
    Transform camera_from_world_;
    bool in_world_ = false, world_ended_ = false;
    std::deque<OpenFile> open_files_;  ///< Each includes the next one.
    size_t first_open_ = 0;            ///< The main file, or the one that is being imported.
    std::deque<FileName> file_names_;  ///< Of all files; parameters refer to them.
    int includes_ = 0;
};

}  // namespace etendue
