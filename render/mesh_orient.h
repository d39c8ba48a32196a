// Inside the repair of meshes: faces that face against their neighbours.
#pragma once
#include "render/mesh.h"

// Turns them over and counts them in mesh->turned. See alb_mesh_repair.
bool alb_mesh_orient(alb_mesh *mesh, alb_error *error);
