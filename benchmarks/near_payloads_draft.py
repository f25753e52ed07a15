"""near payloads: python sort.py KIND seed0 seed1 spread"""
import sys
sys.path.insert(0,'/work/main/benchmarks')
import numpy as np, cell_hours
import event_scenes
from cell_hours import Hours, streamed
from armload.inertia import InertialParameters
from armload.online import OnlineIdentifier
from armload.online import thresholds
kind,s0,s1,spread=sys.argv[1],int(sys.argv[2]),int(sys.argv[3]),float(sys.argv[4])
cell_hours.SECONDS=150.0; cell_hours.APART=(4.0,8.0)
def near(rng,low):
    m=0.3+spread*rng.uniform(-1,1)
    return InertialParameters.from_com(m,np.array([0.005,-0.01,0.07])+0.003*rng.normal(size=3),m*np.diag([1.5e-3,1.7e-3,8e-4])).phi
cell_hours.body=near
LOOK=(0.2,0.5,1.0,2.0,3.5)
rows=[];false=0;kinds={}
for seed in range(s0,s1):
    st=streamed(Hours(kind,seed)); log=st.log
    o=OnlineIdentifier(st.robot); speed=np.abs(log.dq).max(1); at=[]
    for c in st.changes:
        k0=np.searchsorted(log.t,c.start+c.seconds)
        k1=k0+np.flatnonzero(speed[k0:]>0.05)[0] if kind=="standing" and (speed[k0:]>0.05).any() else k0
        if c.phi[0]>0 and k1<len(log.t): at.append((log.t[k1],c.phi[0]))
    todo=sorted((t+d,d,m,t) for t,m in at for d in LOOK); i=0; ev={}
    for s in log:
        e=o.update(*s)
        if e.event is not None: ev[e.event.t]=e.event.kind
        while i<len(todo) and s[0]>=todo[i][0]:
            _,d,m,t=todo[i]; i+=1
            rows.append((seed,t,d,m,e.phi[0]-m,1.96*e.std[0],e.calibrated,e.settling))
    times=np.array([c.start for c in st.changes])
    for t,k in ev.items():
        kinds[k]=kinds.get(k,0)+1
        if not np.any((t>times)&(t<times+2.0)): false+=1; print("FALSE",seed,t,k,flush=True)
r=np.array(rows,float); np.save(f'/tmp/scratch/sort_{kind}_{s0}.npy',r)
for d in LOOK:
    y=r[r[:,2]==d]; ins=np.abs(y[:,4])<=y[:,5]
    print(kind,spread,d,len(y),"err med %.1f mean %.1f"%(np.median(1e3*np.abs(y[:,4])),np.mean(1e3*np.abs(y[:,4]))),"half med %.1f"%np.median(1e3*y[:,5]),"inside %.3f"%ins.mean(),"or doubted %.3f"%(ins|(y[:,6]==0)).mean(),"zrms %.2f"%np.sqrt(np.mean((1.96*y[:,4]/y[:,5])**2)))
print("false",false,kinds)
